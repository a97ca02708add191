"""The track as others want it: of the vehicle's base in place of the sensor."""
from dataclasses import replace
import re

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common import se3
from ..core.common.settings import InputError
from ..tracker import TrackedScan

Array = NDArray[np.float64]


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
    turn = _turned(T_odom_start[:3, :3])
    return replace(tracked, T_odom_sensor=T_odom_start @ tracked.T_odom_sensor,
                   covariance=_through(turn, tracked.covariance))


def of_base(tracked: TrackedScan, T_base_sensor: Array) -> TrackedScan:
    """Return pose, covariance and twist of the base: `T_odom_sensor` is its pose then."""
    if tracked.T_odom_sensor is None:
        return tracked
    T_sensor_base = se3.inverse(T_base_sensor)
    R_odom_sensor, R_base_sensor = tracked.T_odom_sensor[:3, :3], T_base_sensor[:3, :3]
    twist = None
    if tracked.twist is not None:
        twist = _turned(R_base_sensor) @ _moved_by(T_sensor_base[:3, 3]) @ tracked.twist
    lever = _moved_by(R_odom_sensor @ T_sensor_base[:3, 3])
    return replace(tracked, T_odom_sensor=tracked.T_odom_sensor @ T_sensor_base, twist=twist,
                   covariance=_through(lever, tracked.covariance))


class Placement:
    """Where the poses of a track are published: the node's and the replay's way is one.

    The frame that is published, base or sensor, begins a track at the origin of the odom frame,
    or where `begin_at` says.
    """

    def __init__(self) -> None:
        self._T_odom_start: Array | None = None    # the first pose of the sensor
        self._T_odom_child: Array | None = None    # and of what is published, where it was given
        self._covariance = np.zeros((6, 6))
        self._next: tuple[Array, Array] | None = None

    def begin_at(self, T_odom_child: Array, covariance: Array) -> None:
        """Let the next track begin at a pose of the frame that is published."""
        self._next = T_odom_child, covariance

    def place(self, tracked: TrackedScan, T_base_sensor: Array | None) -> TrackedScan:
        """Return a scan of the track with pose, covariance and twist of the base.

        Parameters
        ----------
        tracked : TrackedScan
        T_base_sensor : (4, 4) array or None
            At the stamp of the scan; None where the sensor itself is wanted.
        """
        if tracked.restarted:
            self._T_odom_start = self._T_odom_child = None
            if self._next is not None:
                self._T_odom_child, self._covariance = self._next
                self._next = None
        if T_base_sensor is None and self._T_odom_child is None:
            return tracked
        if T_base_sensor is None:
            T_base_sensor = np.eye(4)
        if self._T_odom_start is None:
            begin = np.eye(4) if self._T_odom_child is None else self._T_odom_child
            self._T_odom_start = begin @ T_base_sensor
        return self._doubted(of_base(in_odom(tracked, self._T_odom_start), T_base_sensor))

    def of_sensor(self, tracked: TrackedScan) -> TrackedScan:
        """Return a scan with the pose of its sensor in the same odom frame."""
        return tracked if self._T_odom_start is None else in_odom(tracked, self._T_odom_start)

    def _doubted(self, placed: TrackedScan) -> TrackedScan:
        """Add the doubt about the pose that the track began at."""
        if self._T_odom_child is None or placed.T_odom_sensor is None or placed.covariance is None:
            return placed
        lever = _moved_by(placed.T_odom_sensor[:3, 3] - self._T_odom_child[:3, 3])
        return replace(placed, covariance=placed.covariance
                       + lever @ self._covariance @ lever.T)


def _moved_by(lever: Array) -> Array:
    """Return the (6, 6) map of (shift, turn) at a point to those at another of a rigid body."""
    x, y, z = lever
    moved = np.eye(6)
    moved[:3, 3:] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return moved


def _turned(R: Array) -> Array:
    """Return the (6, 6) map of (shift, turn) in one frame to those in a frame turned by R."""
    turned = np.zeros((6, 6))
    turned[:3, :3] = turned[3:, 3:] = R
    return turned


def _through(J: Array, covariance: Array | None) -> Array | None:
    return None if covariance is None else J @ covariance @ J.T
