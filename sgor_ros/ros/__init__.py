"""The node: the only place that imports rclpy."""
