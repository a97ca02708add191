"""The method: numpy arrays in, result objects out. No ROS, no printing."""
from . import threads as threads  # first: it sets how OpenMP waits
