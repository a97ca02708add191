"""From the features of two scans to correspondences (paper, Sec. III-B, Eq. 4)."""
