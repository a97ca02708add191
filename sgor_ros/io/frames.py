"""The track as others want it: of the vehicle's base in place of the sensor."""
from dataclasses import dataclass
from dataclasses import replace
import re

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common import se3
from ..core.common.settings import InputError
from ..tracker import TrackedScan

Array = NDArray[np.float64]

REMEMBERED = 100


def frame_id(name: str) -> str:
    """Return a frame id as tf2 has it: without the leading slash of ROS 1."""
    return name.removeprefix('/')


def parse_transform(text: str, name: str) -> Array:
    """Return the (4, 4) transformation of six numbers: x y z roll pitch yaw, m and rad.

    They are those of a URDF's origin: turns about the fixed axes x, y, z, in this order.

    Raises
    ------
    InputError
        Naming `name`, where they are not six finite numbers.
    """
    try:
        numbers = np.array([float(part) for part in re.split(r'[,\s]+', text.strip())])
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != (6,) or not np.isfinite(numbers).all():
        raise InputError(f'{name} = {text!r}: expected six numbers, x y z roll pitch yaw')
    return se3.compose(Rotation.from_euler('xyz', numbers[3:]).as_matrix(), numbers[:3])


def in_odom(tracked: TrackedScan, T_odom_start: Array) -> TrackedScan:
    """Return a scan in an odom frame in which the first pose of the sensor is `T_odom_start`."""
    if tracked.T_odom_sensor is None:
        return tracked
    turn = se3.turned(T_odom_start[:3, :3])
    return replace(tracked, T_odom_sensor=T_odom_start @ tracked.T_odom_sensor,
                   covariance=_through(turn, tracked.covariance))


def of_base(tracked: TrackedScan, T_base_sensor: Array) -> TrackedScan:
    """Return pose, covariance and twist of the base: `T_odom_sensor` is its pose then."""
    if tracked.T_odom_sensor is None:
        return tracked
    T_sensor_base = se3.inverse(T_base_sensor)
    R_odom_sensor, R_base_sensor = tracked.T_odom_sensor[:3, :3], T_base_sensor[:3, :3]
    to_base = se3.turned(R_base_sensor) @ se3.carried(T_sensor_base[:3, 3])
    lever = se3.carried(R_odom_sensor @ T_sensor_base[:3, 3])
    return replace(tracked, T_odom_sensor=tracked.T_odom_sensor @ T_sensor_base,
                   covariance=_through(lever, tracked.covariance),
                   twist=None if tracked.twist is None else to_base @ tracked.twist,
                   twist_covariance=_through(to_base, tracked.twist_covariance))


@dataclass(frozen=True, eq=False)
class _Start:
    """Where a track begins: the sensor, what is published, and the doubt about the latter."""

    T_odom_sensor: Array
    T_odom_child: Array
    covariance: Array


class OdomFrame:
    """The frame that poses are published in, and where each track lies in it.

    The frame that is published, base or sensor, begins a track at the origin of the odom frame,
    or where `begin_at` says.

    Attributes
    ----------
    T_map_mapper : (4, 4) float64 or None
        Where the frame of the mapper, that of its first sensor, lies in the map that is published;
        it is set with the first pose, where nobody has.
    """

    def __init__(self) -> None:
        self._starts: dict[int, _Start] = {}
        self._next: tuple[Array, Array] | None = None
        self.T_map_mapper: Array | None = None

    def begin_at(self, T_odom_child: Array, covariance: Array) -> None:
        """Let the next track begin at a pose of the frame that is published."""
        self._next = T_odom_child, covariance

    def go_on_at(self, T_odom_child: Array, covariance: Array) -> None:
        """Let the next track begin at a pose, unless `begin_at` has said another."""
        self._next = self._next or (T_odom_child, covariance)

    def knows(self, track_id: int) -> bool:
        """Whether a scan of the track has been placed."""
        return track_id in self._starts

    def in_map(self, T_first_sensor: Array) -> Array:
        """Return poses (..., 4, 4) in the frame of the mapper, of the first scan, in the map."""
        assert self.T_map_mapper is not None, 'a track has been placed'
        return self.T_map_mapper @ T_first_sensor

    def map_to_odom(self, track_id: int, T_map_track: Array) -> Array:
        """Return the pose of the odom frame in the map, (4, 4).

        The map begins where the odom frame does. A track that is placed in it lies in the mapper's
        frame, that of the first scan, at `T_map_track`.
        """
        return self.in_map(T_map_track) @ se3.inverse(self._starts[track_id].T_odom_sensor)

    def place(self, tracked: TrackedScan, T_base_sensor: Array | None) -> TrackedScan:
        """Return a scan of the track with pose, covariance and twist of the base.

        Parameters
        ----------
        tracked : TrackedScan
        T_base_sensor : (4, 4) array or None
            At the stamp of the scan; None where the sensor itself is wanted.
        """
        if tracked.T_odom_sensor is None:
            return tracked
        mount = np.eye(4) if T_base_sensor is None else T_base_sensor
        start = self._starts.get(tracked.track_id)
        if start is None:
            T, covariance = self._next or (np.eye(4), np.zeros((6, 6)))
            self._next = None
            # tracks that can come back are few
            self._starts = dict(list(self._starts.items())[-REMEMBERED:])
            start = self._starts[tracked.track_id] = _Start(T @ mount, T, covariance)
            if self.T_map_mapper is None:
                self.T_map_mapper = start.T_odom_sensor
        return _doubted(of_base(in_odom(tracked, start.T_odom_sensor), mount), start)

    def of_sensor(self, tracked: TrackedScan) -> TrackedScan:
        """Return a scan with the pose of its sensor in the same odom frame."""
        start = self._starts.get(tracked.track_id)
        return tracked if start is None else in_odom(tracked, start.T_odom_sensor)


def _doubted(placed: TrackedScan, start: _Start) -> TrackedScan:
    """Add the doubt about the pose that the track began at."""
    if placed.T_odom_sensor is None or placed.covariance is None:
        return placed
    lever = se3.carried(placed.T_odom_sensor[:3, 3] - start.T_odom_child[:3, 3])
    return replace(placed,
                   covariance=placed.covariance + lever @ start.covariance @ lever.T)


def _through(J: Array, covariance: Array | None) -> Array | None:
    return None if covariance is None else J @ covariance @ J.T
