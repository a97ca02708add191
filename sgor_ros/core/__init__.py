"""The method: numpy arrays in, result objects out. No ROS, no printing."""
