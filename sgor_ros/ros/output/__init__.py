"""Results out of the node: publishers, and the transform to the base that they need."""
