"""Message classes of rclpy by name, as `sgor_ros.io.messages` asks for them."""
from functools import cache
from importlib import import_module
from typing import Any


@cache
def ros_type(name: str) -> Any:
    """Return the class of a name such as ``'nav_msgs/msg/Odometry'``."""
    package, kind, message = name.split('/')
    return getattr(import_module(f'{package}.{kind}'), message)
