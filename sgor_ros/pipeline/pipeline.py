"""A scan in, everything that is published of it out: one implementation for node and replay."""
from collections.abc import Iterator
from dataclasses import replace
import logging
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.scan.scan import SemanticScan
from ..io import messages
from ..io.frames import frame_id
from ..io.frames import OdomFrame
from ..io.sequence import StampedScan
from ..io.stream_config import StreamConfig
from ..tracker import TrackedScan
from ..tracker import Tracker
from .extrinsic import Extrinsic
from .outcome import Outcome
from .sinks import CORRESPONDENCES
from .sinks import MessageSink
from .sinks import ODOMETRY
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
    tracker : Tracker
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
    """

    def __init__(self, tracker: Tracker, config: StreamConfig, sink: MessageSink | None = None,
                 extrinsic: Extrinsic | None = None, *, inverted_tf: bool = False) -> None:
        self.tracker = tracker
        self._config = config
        self._sink = sink
        self._extrinsic = extrinsic
        self._inverted_tf = inverted_tf
        self._odom_frame = OdomFrame()
        self._frame = ''
        self._keyframe_frames: dict[int, str] = {}

    def begin_at(self, T_odom_child: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Let the next track begin at a pose, (4, 4) with (6, 6), of the frame it publishes."""
        self._odom_frame.begin_at(T_odom_child, covariance)

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
        tracked = self._track(points, scan.stamp_ns, frame)
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

    def _track(self, scan: SemanticScan, stamp_ns: int, frame: str) -> TrackedScan:
        tracked = self.tracker.track(scan, stamp_ns)
        before, self._frame = self._frame, frame
        if before in ('', frame) or tracked.restarted:
            return tracked
        # the pose is right all the same, the motion is not that of one sensor
        return replace(tracked, twist=None, twist_covariance=None, warnings=(
            *tracked.warnings, f'the frame of the clouds changed from {before} to {frame}'))

    def _place(self, tracked: TrackedScan, frame: str) -> TrackedScan | str:
        """Return the scan as one of the base, in the odom frame, or why it cannot be placed."""
        if not tracked.success or self._extrinsic is None:
            return self._odom_frame.place(tracked, None)
        T_base_sensor = self._extrinsic(tracked.stamp_ns, frame)
        if isinstance(T_base_sensor, str):
            return T_base_sensor
        return self._odom_frame.place(tracked, T_base_sensor)

    def _messages(self, sink: MessageSink, tracked: TrackedScan, placed: TrackedScan | str,
                  frame: str, reference_frame: str) -> Iterator[tuple[str, Any]]:
        """Yield topic and message of all that is published of a scan."""
        odom, child = self._config.odom_frame, self._config.base_frame or frame
        if tracked.success and tracked.T_reference_sensor is not None:
            yield RELATIVE_POSE, messages.relative_pose(sink.types, tracked, frame,
                                                        reference_frame)
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
