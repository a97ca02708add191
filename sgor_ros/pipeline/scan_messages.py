"""The messages that are published of a scan."""
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..io import messages
from ..io.stream_config import StreamConfig
from ..mapping import MappedScan
from ..mapping import Mapper
from ..mapping.map_cloud import map_cloud
from ..tracker import TrackedScan
from .published_frames import PublishedFrames
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

Array = NDArray[np.float64]
Message = tuple[str, Any]
"""A topic and what is published there."""

KEYFRAMES = 1000
"""Keyframes whose sensor frames are remembered: more than the tracker can keep."""


class ScanMessages:
    """Makes the messages that a sink wants.

    Parameters
    ----------
    sink : MessageSink
    config : StreamConfig
        Names of the frames.
    frames : PublishedFrames
    mapper : Mapper or None
    inverted_tf : bool
        Whether odom is the child frame on /tf.
    """

    def __init__(self, sink: MessageSink, config: StreamConfig, frames: PublishedFrames,
                 mapper: Mapper | None, *, inverted_tf: bool) -> None:
        self._sink, self._config, self._frames = sink, config, frames
        self._mapper = mapper
        self._inverted_tf = inverted_tf
        self._keyframe_frames: dict[int, str] = {}
        self._told_hypotheses = False

    def of(self, tracked: TrackedScan, placed: TrackedScan | str, frame: str) -> Iterator[Message]:
        """Yield topic and message of all that is published of a scan.

        Parameters
        ----------
        tracked : TrackedScan
            As the tracker has it.
        placed : TrackedScan or str
            As of `PublishedFrames.place`.
        frame : str
            Of the sensor.
        """
        types = self._sink.types
        reference_frame = self._frame_of_reference(tracked, frame)
        if tracked.success and tracked.T_reference_sensor is not None:
            yield RELATIVE_POSE, messages.relative_pose(types, tracked, frame, reference_frame)
        if isinstance(tracked, MappedScan):
            yield from self._of_map(tracked, frame)
        if isinstance(placed, str):
            return
        if placed.T_odom_sensor is not None:
            yield from self._of_pose(placed, placed.T_odom_sensor, frame)
        if self._sink.wants(CORRESPONDENCES):
            yield CORRESPONDENCES, messages.correspondence_markers(
                types, self._frames.odom.of_sensor(tracked), self._config.odom_frame)

    def _frame_of_reference(self, tracked: TrackedScan, frame: str) -> str:
        """Return the sensor frame of what a scan was registered to; remember its own."""
        reference_frame = self._keyframe_frames.get(tracked.reference_id or 0, frame)
        if tracked.keyframe_id is not None:
            self._keyframe_frames = dict(list(self._keyframe_frames.items())[-KEYFRAMES:])
            self._keyframe_frames[tracked.keyframe_id] = frame
        return reference_frame

    def _of_pose(self, placed: TrackedScan, T_odom_child: Array, frame: str) -> Iterator[Message]:
        """Yield the pose in the odom frame."""
        odom, child = self._config.odom_frame, self._config.base_frame or frame
        yield ODOMETRY, messages.odometry(self._sink.types, placed, odom, child)
        yield POSE, messages.pose_stamped(self._sink.types, placed, odom)
        if self._sink.wants(TF):
            yield self._tf(T_odom_child, placed.stamp_ns, odom, child)

    def _tf(self, T_parent_child: Array, stamp_ns: int, parent: str, child: str) -> Message:
        """Return a transform; inverted where odom is to be a child."""
        T, ends = T_parent_child, (parent, child)
        if self._inverted_tf:
            T, ends = se3.inverse(T), (child, parent)
        return TF, messages.tf_message(self._sink.types, T, stamp_ns, *ends)

    def _of_map(self, mapped: MappedScan, frame: str) -> Iterator[Message]:
        """Yield what a mapper adds: loops, where odom lies in the map, and the way in it."""
        assert self._mapper is not None
        types, odom, of_map = self._sink.types, self._frames.odom, self._config.map_frame
        for loop in mapped.loops:
            yield LOOP_CLOSURE, messages.loop_closure(types, loop, frame)
        if mapped.hypotheses or self._told_hypotheses:
            yield HYPOTHESES, messages.pose_array(
                types, self._frames.hypotheses(mapped, frame), mapped.stamp_ns, of_map)
            self._told_hypotheses = bool(mapped.hypotheses)    # none once, where it is found
        if mapped.T_map_odom is None or not odom.knows(mapped.track_id):
            return
        if self._sink.wants(TF):
            yield self._tf(odom.map_to_odom(mapped.track_id, mapped.T_map_odom), mapped.stamp_ns,
                           of_map, self._config.odom_frame)
        if (mapped.keyframe or mapped.loops) and self._sink.wants(PATH):
            stamps_ns, poses = self._mapper.node_poses()
            yield PATH, messages.path(types, stamps_ns, odom.in_map(poses), mapped.stamp_ns,
                                      of_map)
        if mapped.keyframe and self._sink.wants(MAP_CLOUD):
            yield MAP_CLOUD, messages.point_cloud2(
                types, *self._map_cloud(self._mapper), mapped.stamp_ns, of_map)

    def _map_cloud(self, mapper: Mapper) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        points, labels = map_cloud(mapper.keyframes, mapper.graph)
        moved = se3.transform(self._frames.odom.in_map(np.eye(4)), points.astype(np.float64))
        return moved.astype(np.float32), labels
