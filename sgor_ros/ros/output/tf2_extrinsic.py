"""The pose of the sensor on the vehicle, looked up in tf2."""
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time

from ...core.common.settings import InputError
from ...io.messages import matrix_of_transform
from ...pipeline.extrinsic import Extrinsic

PATIENCE_S = 0.05
"""How long a scan waits for a transform that comes after it."""


def tf2_extrinsic(node: Node, base_frame: str) -> Extrinsic:
    """Return what looks the transformation up at the stamp of each scan.

    Raises
    ------
    InputError
        There is no tf2_ros.
    """
    try:
        import tf2_ros
    except ImportError as error:
        raise InputError(
            f'base_frame = {base_frame!r}: without T_base_sensor it needs tf2_ros, which is not '
            'installed (apt install ros-jazzy-tf2-ros-py)') from error
    buffer: Any = tf2_ros.Buffer(node=node)
    listener = tf2_ros.TransformListener(buffer, node)

    def look_up(stamp_ns: int, sensor_frame: str) -> NDArray[np.float64] | str:
        assert listener    # it lives as long as this function
        try:
            found = buffer.lookup_transform(
                base_frame, sensor_frame, Time(nanoseconds=stamp_ns),
                timeout=Duration(seconds=PATIENCE_S))
        except (tf2_ros.TransformException, ValueError) as error:    # a time before 1970
            return f'no transform from {sensor_frame} to {base_frame}: {error}'
        return matrix_of_transform(found.transform)

    return look_up
