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


class Mount:
    """The extrinsic, asked once for each scan.

    Parameters
    ----------
    extrinsic : callable or None
        None where the pose of the sensor is published.
    config : StreamConfig
    """

    def __init__(self, extrinsic: Extrinsic | None, config: StreamConfig) -> None:
        self._extrinsic = extrinsic
        self._config = config
        self._last: tuple[str, int, NDArray[np.float64]] | None = None    # frame, stamp, pose

    @property
    def known(self) -> bool:
        """Whether there is a base whose pose is published."""
        return self._extrinsic is not None

    def T_base_sensor(self, stamp_ns: int, frame: str) -> NDArray[np.float64] | str:
        """Return the mount at a stamp, or why there is none; the identity without a base."""
        if self._extrinsic is None:
            return np.eye(4)
        if self._last is not None and self._last[:2] == (frame, stamp_ns):
            return self._last[2]
        found = self._extrinsic(stamp_ns, frame)
        if not isinstance(found, str):
            self._last = frame, stamp_ns, found
        return found

    def of(self, scan: SemanticScan, stamp_ns: int, frame: str) -> SemanticScan:
        """Return the scan with which way is up, by the mount of the scan before or its own.

        Where the mount of its own frame is known no scan waits for a transform before it is
        tracked.
        """
        if self._extrinsic is None:
            return scan
        if ((self._last is None or self._last[0] != frame)
                and isinstance(self.T_base_sensor(stamp_ns, frame), str)):
            return scan
        assert self._last is not None
        return mounted(scan, frame, self._last[2], self._config)
