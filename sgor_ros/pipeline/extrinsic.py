"""The pose of the sensor on the vehicle, at the stamp of a scan."""
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..io.frames import parse_transform
from ..io.stream_config import StreamConfig

Extrinsic = Callable[[int, str], NDArray[np.float64] | str]
"""Stamp in nanoseconds and sensor frame to (4, 4) T_base_sensor, or why there is none."""


def configured(config: StreamConfig) -> Extrinsic | None:
    """Return the fixed `T_base_sensor` of the configuration; None where it has none."""
    if not config.T_base_sensor:
        return None
    T_base_sensor = parse_transform(config.T_base_sensor, 'T_base_sensor')
    return lambda stamp_ns, sensor_frame: T_base_sensor
