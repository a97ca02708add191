"""Poses of tracker and mapper in the frames that are published: map, odom, base or sensor."""
import math

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..io.frames import OdomFrame
from ..mapping import MappedScan
from ..mapping import Mapper
from ..tracker import TrackedScan
from ..tracker import Tracker
from .extrinsic import Mount

Array = NDArray[np.float64]


class PublishedFrames:
    """Where map and odom lie, and the child frame, base or sensor, in them (REP 105).

    Parameters
    ----------
    tracker : Tracker
    mapper : Mapper or None
    mount : Mount
        The pose of the sensor in the child frame.

    Attributes
    ----------
    odom : OdomFrame
    mount : Mount
    """

    def __init__(self, tracker: Tracker, mapper: Mapper | None, mount: Mount) -> None:
        self._tracker, self._mapper = tracker, mapper
        self.mount = mount
        self.odom = OdomFrame()
        self._last: TrackedScan | None = None
        if mapper is not None:
            self.odom.T_map_mapper = mapper.T_base_sensor

    def place(self, tracked: TrackedScan, frame: str) -> TrackedScan | str:
        """Return the scan as one of the base, in the odom frame, or why it cannot be placed."""
        T_base_sensor: Array | None = None
        if tracked.success and self.mount.known:
            found = self.mount.T_base_sensor(tracked.stamp_ns, frame)
            if isinstance(found, str):
                return found
            T_base_sensor = found
        if self._mapper is not None:
            self._begin_in_map(self._mapper, tracked, T_base_sensor)
        placed = self.odom.place(tracked, T_base_sensor)
        if placed.T_odom_sensor is not None:
            self._last = placed
        return placed

    def _begin_in_map(self, mapper: Mapper, tracked: TrackedScan, T_base_sensor: Array | None
                      ) -> None:
        """Let the mapper know the mount, and odom where a new track begins in it."""
        if T_base_sensor is not None and mapper.T_base_sensor is None:
            mapper.T_base_sensor = T_base_sensor
        if mapper.begun_in_map and tracked.success:
            self.odom.T_map_mapper = self.T_map_mapper(
                np.eye(4) if T_base_sensor is None else T_base_sensor)
        if tracked.restarted and self._last is not None:
            # odom never jumps where there is a map: the map does (REP-105)
            self.odom.go_on_at(*self._predicted(self._last, tracked.stamp_ns))

    def _predicted(self, last: TrackedScan, stamp_ns: int) -> tuple[Array, Array]:
        """Return where a pose leads to if it goes on as it did, and the covariance of that.

        Whatever ended the track, the bounds on its motion hold: half of them is one sigma.
        """
        assert last.T_odom_sensor is not None
        config, seconds = self._tracker.tracker_config, (stamp_ns - last.stamp_ns) * 1e-9
        ahead = np.eye(4) if last.twist is None else se3.exp(last.twist * seconds)
        sigma = np.array([config.max_speed / 2 * seconds] * 3
                         + [min(config.max_turn_rate / 2 * seconds, math.pi)] * 3)
        before = np.zeros((6, 6)) if last.covariance is None else last.covariance
        return last.T_odom_sensor @ ahead, before + np.diag(sigma**2)

    def T_map_mapper(self, T_child_sensor: Array) -> Array:
        """Return where the mapper's frame lies in the map; one without a mount takes today's."""
        T = self.odom.T_map_mapper
        return T_child_sensor if T is None else T

    def sensor_in_mapper(self, T_map_child: Array, stamp_ns: int, frame: str) -> Array | None:
        """Return the pose of the sensor in the mapper's frame; None while the mount is unknown."""
        mount = self.mount.T_base_sensor(stamp_ns, frame)
        return None if isinstance(mount, str) else (
            se3.inverse(self.T_map_mapper(mount)) @ T_map_child @ mount)

    def hypotheses(self, mapped: MappedScan, frame: str) -> list[Array]:
        """Return where in the map the child may be, (4, 4); none while the mount is unknown."""
        mount = self.mount.T_base_sensor(mapped.stamp_ns, frame)
        return [] if isinstance(mount, str) else [
            self.T_map_mapper(mount) @ T @ se3.inverse(mount) for T in mapped.hypotheses]
