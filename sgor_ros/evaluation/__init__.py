"""How good a registration or a trajectory is, against ground truth."""
