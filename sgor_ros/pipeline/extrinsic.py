"""The pose of the sensor on the vehicle, at the stamp of a scan."""
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..core.scan.scan import SemanticScan
from ..io.frames import parse_transform
from ..io.stream_config import StreamConfig

Extrinsic = Callable[[int, str], NDArray[np.float64] | str]
"""Stamp in nanoseconds and sensor frame to (4, 4) T_base_sensor, or why there is none."""


def configured(config: StreamConfig) -> Extrinsic | None:
    """Return the fixed `T_base_sensor` of the configuration; None where it has none.

    A cloud whose frame is that of the base lies in it already.
    """
    if not config.T_base_sensor:
        return None
    T_base_sensor = parse_transform(config.T_base_sensor, 'T_base_sensor')
    return lambda stamp_ns, frame: np.eye(4) if frame == config.base_frame else T_base_sensor


def mounted(scan: SemanticScan, frame: str, T_base_cloud: NDArray[np.float64],
            config: StreamConfig) -> SemanticScan:
    """Return a scan that knows which way is up, and where the sensor is where that is told.

    Parameters
    ----------
    scan : SemanticScan
    frame : str
        That of the cloud.
    T_base_cloud : (4, 4) array
        Its pose in the frame of the base, whose z axis is up (REP 103).
    config : StreamConfig
        Its `T_base_sensor` tells where the sensor is in a cloud that lies in the frame of the
        base; every other cloud has its sensor at the origin.
    """
    origin = None
    if frame == config.base_frame and config.T_base_sensor:
        origin = parse_transform(config.T_base_sensor, 'T_base_sensor')[:3, 3]
    return scan.mounted(up=T_base_cloud[2, :3], origin=origin)
