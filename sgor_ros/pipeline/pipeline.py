"""A scan in, everything that is published of it out: one implementation for node and replay."""
from collections.abc import Iterator
from dataclasses import replace
import logging
import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.scan.deskewing import deskewed
from ..core.scan.scan import SemanticScan
from ..io import messages
from ..io.frames import frame_id
from ..io.frames import OdomFrame
from ..io.sequence import StampedScan
from ..io.stream_config import StreamConfig
from ..mapping import Map
from ..mapping import MappedScan
from ..mapping import Mapper
from ..mapping.map_cloud import map_cloud
from ..tracker import TrackedScan
from ..tracker import Tracker
from .extrinsic import Extrinsic
from .extrinsic import mounted
from .outcome import Outcome
from .query import Query
from .sinks import CORRESPONDENCES
from .sinks import HYPOTHESES
from .sinks import LOOP_CLOSURE
from .sinks import MAP_CLOUD
from .sinks import MessageSink
from .sinks import ODOMETRY
from .sinks import PATH
from .sinks import POSE
from .sinks import RELATIVE_POSE
from .sinks import TF

LOGGER = logging.getLogger('sgor_ros')

KEYFRAMES = 1000
"""Keyframes whose sensor frames are remembered: more than the tracker can keep."""


class Pipeline:
    """Reads, tracks and places one scan after the other, and publishes what there is of each.

    Whatever a cloud brings about, its scan fails with the reason and the next is another. What a
    sink raises while it writes, such as a full disk, is no fault of a cloud and passes through.

    Parameters
    ----------
    tracker : Tracker or Mapper
        A mapper closes loops, too.
    config : StreamConfig
        Names of the frames.
    sink : MessageSink, optional
        Without it no messages are made.
    extrinsic : callable, optional
        Without it the pose of the sensor is published.
    inverted_tf : bool
        Whether odom is the child frame on /tf: for a base that has a parent already.

    Attributes
    ----------
    tracker : Tracker
    mapper : Mapper or None
    """

    def __init__(self, tracker: Tracker | Mapper, config: StreamConfig,
                 sink: MessageSink | None = None, extrinsic: Extrinsic | None = None, *,
                 inverted_tf: bool = False) -> None:
        self.mapper = tracker if isinstance(tracker, Mapper) else None
        self.tracker = tracker.tracker if isinstance(tracker, Mapper) else tracker
        self._config = config
        self._sink = sink
        self._extrinsic = extrinsic
        self._inverted_tf = inverted_tf
        self._odom_frame = OdomFrame()
        self._frame = ''
        self._keyframe_frames: dict[int, str] = {}
        self._placed: TrackedScan | None = None
        self._mount: tuple[str, int, NDArray[np.float64]] | None = None    # frame, stamp, pose
        self._hint: NDArray[np.float64] | None = None
        self._told_hypotheses = False
        if self.mapper is not None:
            self._odom_frame.T_map_mapper = self.mapper.T_base_sensor

    def begin_at(self, T_odom_child: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Let the next track begin at a pose, (4, 4) with (6, 6), of the frame it publishes."""
        self._odom_frame.begin_at(T_odom_child, covariance)

    def begin_in(self, known: Map) -> None:
        """Let the mapper go on in another map; odom goes on.

        Raises
        ------
        InputError
            Its settings do not go with those of the mapper.
        """
        assert self.mapper is not None, 'a mapper has a map'
        self.mapper.begin_in(known)
        self._odom_frame.T_map_mapper = known.T_base_sensor

    def hint(self, T_map_child: NDArray[np.float64]) -> None:
        """Look for what is published near a pose of the map, (4, 4), while it is lost there."""
        self._hint = T_map_child

    def query(self, outcome: Outcome) -> Query:
        """Return the scan of an outcome, to be found in the map.

        Raises
        ------
        InputError
            It could not be read, or nobody knows its mount.
        """
        if outcome.scan is None:
            raise InputError(outcome.reason)
        mount = self._T_child_sensor(outcome.stamp_ns, outcome.frame)
        if isinstance(mount, str):
            raise InputError(mount)
        scan = self._mounted(outcome.scan, outcome.stamp_ns, outcome.frame)
        if outcome.tracked is not None and outcome.tracked.twist is not None:
            scan = deskewed(scan, outcome.tracked.twist)
        return Query(scan, outcome.stamp_ns, self._config.base_frame or outcome.frame,
                     self._T_map_mapper(mount), mount)

    def process(self, scan: StampedScan) -> Outcome:
        """Take the next scan and write its messages; an unusable one is an outcome, too."""
        frame = self._config.sensor_frame or frame_id(scan.frame_id)
        try:
            outcome, published = self._outcome(scan, frame)
        except InputError as error:
            return Outcome(scan.stamp_ns, frame, str(error))
        except Exception as error:
            # a robot depends on this process: no cloud may end it
            LOGGER.exception('scan at %.3f s: fault of the program', scan.stamp_ns * 1e-9)
            return Outcome(scan.stamp_ns, frame,
                           f'fault of the program: {type(error).__name__}: {error}')
        if self._sink:
            for topic, message in published:
                self._sink.write(topic, message, scan.arrived_ns)
        return outcome

    def _outcome(self, scan: StampedScan, frame: str) -> tuple[Outcome, list[tuple[str, Any]]]:
        """Return what became of a scan, and its messages by topic."""
        begin = time.perf_counter()
        points = scan.read()
        tracked = self._track(self._mounted(points, scan.stamp_ns, frame), scan.stamp_ns, frame)
        seconds = time.perf_counter() - begin
        placed = self._place(tracked, frame)
        reference_frame = self._keyframe_frames.get(tracked.reference_id or 0, frame)
        if tracked.keyframe_id is not None:
            self._keyframe_frames = dict(list(self._keyframe_frames.items())[-KEYFRAMES:])
            self._keyframe_frames[tracked.keyframe_id] = frame
        published = ([] if self._sink is None else
                     list(self._messages(self._sink, tracked, placed, frame, reference_frame)))
        reason, T_odom_child = ((placed, None) if isinstance(placed, str)
                                else (tracked.reason, placed.T_odom_sensor))
        return Outcome(scan.stamp_ns, frame, reason, points, tracked, T_odom_child,
                       seconds), published

    def _mounted(self, scan: SemanticScan, stamp_ns: int, frame: str) -> SemanticScan:
        """Return the scan with which way is up, by the mount of the scan before or its own.

        Where the mount of its own frame is known no scan waits for a transform before it is
        tracked.
        """
        if self._extrinsic is None:
            return scan
        if ((self._mount is None or self._mount[0] != frame)
                and isinstance(self._T_base_sensor(stamp_ns, frame), str)):
            return scan
        assert self._mount is not None
        return mounted(scan, frame, self._mount[2], self._config)

    def _T_base_sensor(self, stamp_ns: int, frame: str) -> NDArray[np.float64] | str:
        """Return the mount at a stamp, asked for once, or why there is none."""
        assert self._extrinsic is not None
        if self._mount is not None and self._mount[:2] == (frame, stamp_ns):
            return self._mount[2]
        found = self._extrinsic(stamp_ns, frame)
        if not isinstance(found, str):
            self._mount = frame, stamp_ns, found
        return found

    def _T_child_sensor(self, stamp_ns: int, frame: str) -> NDArray[np.float64] | str:
        """Return the pose of the sensor in the frame that is published, or why there is none."""
        return np.eye(4) if self._extrinsic is None else self._T_base_sensor(stamp_ns, frame)

    def _T_map_mapper(self, T_child_sensor: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the mapper's frame lies in the map; one without a mount takes today's."""
        T = self._odom_frame.T_map_mapper
        return T_child_sensor if T is None else T

    def _give_hint(self, stamp_ns: int, frame: str) -> None:
        """Hand the hint on to the mapper, as a pose of the sensor in its frame."""
        if self._hint is None or self.mapper is None:
            return
        mount = self._T_child_sensor(stamp_ns, frame)
        if not isinstance(mount, str):
            self.mapper.hint(se3.inverse(self._T_map_mapper(mount)) @ self._hint @ mount)
            self._hint = None

    def _track(self, scan: SemanticScan, stamp_ns: int, frame: str) -> TrackedScan:
        self._give_hint(stamp_ns, frame)
        tracked = (self.mapper or self.tracker).track(scan, stamp_ns)
        before, self._frame = self._frame, frame
        if before in ('', frame) or tracked.restarted:
            return tracked
        # the pose is right all the same, the motion is not that of one sensor
        return replace(tracked, twist=None, twist_covariance=None, warnings=(
            *tracked.warnings, f'the frame of the clouds changed from {before} to {frame}'))

    def _place(self, tracked: TrackedScan, frame: str) -> TrackedScan | str:
        """Return the scan as one of the base, in the odom frame, or why it cannot be placed."""
        T_base_sensor: NDArray[np.float64] | None = None
        if tracked.success and self._extrinsic is not None:
            found = self._T_base_sensor(tracked.stamp_ns, frame)
            if isinstance(found, str):
                return found
            T_base_sensor = found
            if self.mapper is not None and self.mapper.T_base_sensor is None:
                self.mapper.T_base_sensor = found
        if self.mapper is not None and self.mapper.begun_in_map and tracked.success:
            mount = np.eye(4) if T_base_sensor is None else T_base_sensor
            self._odom_frame.T_map_mapper = self._T_map_mapper(mount)
        if self.mapper is not None and tracked.restarted and self._placed is not None:
            # odom never jumps where there is a map: the map does (REP-105)
            self._odom_frame.go_on_at(*self._predicted(self._placed, tracked.stamp_ns))
        placed = self._odom_frame.place(tracked, T_base_sensor)
        if placed.T_odom_sensor is not None:
            self._placed = placed
        return placed

    def _predicted(self, placed: TrackedScan, stamp_ns: int
                   ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where a pose leads to if it goes on as it did, and what is known of that.

        Whatever ended the track, the bounds on its motion hold: half of them is one sigma.
        """
        assert placed.T_odom_sensor is not None
        config, seconds = self.tracker.tracker_config, (stamp_ns - placed.stamp_ns) * 1e-9
        ahead = np.eye(4) if placed.twist is None else se3.exp(placed.twist * seconds)
        sigma = np.array([config.max_speed / 2 * seconds] * 3
                         + [min(config.max_turn_rate / 2 * seconds, math.pi)] * 3)
        before = np.zeros((6, 6)) if placed.covariance is None else placed.covariance
        return placed.T_odom_sensor @ ahead, before + np.diag(sigma**2)

    def _messages(self, sink: MessageSink, tracked: TrackedScan, placed: TrackedScan | str,
                  frame: str, reference_frame: str) -> Iterator[tuple[str, Any]]:
        """Yield topic and message of all that is published of a scan."""
        odom, child = self._config.odom_frame, self._config.base_frame or frame
        if tracked.success and tracked.T_reference_sensor is not None:
            yield RELATIVE_POSE, messages.relative_pose(sink.types, tracked, frame,
                                                        reference_frame)
        if isinstance(tracked, MappedScan):
            yield from self._map_messages(sink, tracked, frame)
        if isinstance(placed, str):
            return
        if placed.T_odom_sensor is not None:
            yield ODOMETRY, messages.odometry(sink.types, placed, odom, child)
            yield POSE, messages.pose_stamped(sink.types, placed, odom)
            if sink.wants(TF):
                T, ends = placed.T_odom_sensor, (odom, child)
                if self._inverted_tf:
                    T, ends = se3.inverse(T), (child, odom)
                yield TF, messages.tf_message(sink.types, T, tracked.stamp_ns, *ends)
        if sink.wants(CORRESPONDENCES):
            yield CORRESPONDENCES, messages.correspondence_markers(
                sink.types, self._odom_frame.of_sensor(tracked), odom)

    def _map_messages(self, sink: MessageSink, mapped: MappedScan, frame: str
                      ) -> Iterator[tuple[str, Any]]:
        """Yield what a mapper adds: loops, where odom lies in the map, and the way in it."""
        assert self.mapper is not None
        for loop in mapped.loops:
            yield LOOP_CLOSURE, messages.loop_closure(sink.types, loop, frame)
        if mapped.hypotheses or self._told_hypotheses:
            yield HYPOTHESES, messages.pose_array(
                sink.types, self._hypotheses(mapped, frame), mapped.stamp_ns,
                self._config.map_frame)
            self._told_hypotheses = bool(mapped.hypotheses)    # none once, where it is found
        if mapped.T_map_odom is None or not self._odom_frame.knows(mapped.track_id):
            return
        T_map_odom = self._odom_frame.map_to_odom(mapped.track_id, mapped.T_map_odom)
        of_map, of_odom = self._config.map_frame, self._config.odom_frame
        if sink.wants(TF):
            ends = (of_odom, of_map) if self._inverted_tf else (of_map, of_odom)
            T = se3.inverse(T_map_odom) if self._inverted_tf else T_map_odom
            yield TF, messages.tf_message(sink.types, T, mapped.stamp_ns, *ends)
        if (mapped.keyframe or mapped.loops) and sink.wants(PATH):
            stamps_ns, poses = self.mapper.node_poses()
            yield PATH, messages.path(sink.types, stamps_ns, self._odom_frame.in_map(poses),
                                      mapped.stamp_ns, of_map)
        if mapped.keyframe and sink.wants(MAP_CLOUD):
            yield MAP_CLOUD, messages.point_cloud2(
                sink.types, *self._map_cloud(), mapped.stamp_ns, of_map)

    def _hypotheses(self, mapped: MappedScan, frame: str) -> list[NDArray[np.float64]]:
        """Return where in the map what is published may be; nothing while the mount is unknown."""
        mount = self._T_child_sensor(mapped.stamp_ns, frame)
        return [] if isinstance(mount, str) else [
            self._T_map_mapper(mount) @ T @ se3.inverse(mount) for T in mapped.hypotheses]

    def _map_cloud(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        assert self.mapper is not None
        points, labels = map_cloud(self.mapper.keyframes, self.mapper.graph)
        moved = se3.transform(self._odom_frame.in_map(np.eye(4)), points.astype(np.float64))
        return moved.astype(np.float32), labels
