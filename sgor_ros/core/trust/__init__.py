"""Whether a transformation is to be believed, and in which directions (beyond the paper)."""
