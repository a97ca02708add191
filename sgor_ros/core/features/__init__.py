"""The keypoints of one scan and their descriptors (paper, Sec. III-B and III-C)."""
