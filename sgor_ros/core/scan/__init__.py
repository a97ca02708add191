"""One scan: its points, labels, voxels, ground and size (paper, Sec. III-B)."""
