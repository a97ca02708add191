"""Competing hypotheses: other poses that may explain two scans as well (perceptual aliasing)."""
