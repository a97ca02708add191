"""Where the sensor sits on the vehicle: base from sensor, fixed or through tf2."""
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time

from ..core.common.settings import InputError
from ..io.messages import matrix_of_transform

Array = NDArray[np.float64]
# stamp in nanoseconds and sensor frame to (4, 4) T_base_sensor, or the reason why there is none
Extrinsic = Callable[[int, str], Array | str]

# how long a scan waits for a transform that comes after it
PATIENCE_S = 0.05


def fixed(T_base_sensor: Array) -> Extrinsic:
    """Return the same transformation for every scan."""
    return lambda stamp_ns, sensor_frame: T_base_sensor


def by_tf2(node: Node, base_frame: str) -> Extrinsic:
    """Look the transformation up at the stamp of each scan.

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

    def look_up(stamp_ns: int, sensor_frame: str) -> Array | str:
        assert listener    # it lives as long as this function
        try:
            found = buffer.lookup_transform(
                base_frame, sensor_frame, Time(nanoseconds=stamp_ns),
                timeout=Duration(seconds=PATIENCE_S))
        except tf2_ros.TransformException as error:
            return f'no transform from {sensor_frame} to {base_frame}: {error}'
        return matrix_of_transform(found.transform)

    return look_up
