"""Everything of one scan that does not depend on another (paper, Sec. III-B)."""
