"""Pose scoring: overlap and free-space violations of one pose, and two poses compared by them."""
