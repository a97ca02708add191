"""From correspondences to one transformation (paper, Sec. III-B to III-E)."""
