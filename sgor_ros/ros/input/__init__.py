"""Clouds into the node: subscription, the latest of them, and those that never came."""
