"""What `sgor_replay` does with one cloud after the other, and what it keeps of them."""
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
import math
import sys
import time
from typing import Any
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..core.common.settings import InputError
from ..io import messages
from ..io.bags import BagWriter
from ..io.bags import RecordedCloud
from ..io.frames import frame_id
from ..io.frames import OdomFrame
from ..io.frames import parse_transform
from ..io.label_field import choice_in_words
from ..io.label_field import label_field_of
from ..io.pointcloud2 import decode
from ..io.stream_config import StreamConfig
from ..tracker import TrackedScan
from ..tracker import Tracker

if TYPE_CHECKING:
    from ..visualize.track import TrackView

# then the terminal has seen enough; summary.json has them all
PRINTED_WARNINGS = 20


@dataclass(frozen=True, eq=False)
class Row:
    """What is kept of a scan: little, for a bag may have many."""

    stamp_ns: int
    reason: str
    T_odom_sensor: NDArray[np.float64] | None = None
    restarted: bool = False
    inliers: int | None = None
    confidence: float = math.nan
    seconds: float = math.nan
    timings: dict[str, float] = field(default_factory=dict)


class Warnings:
    """Tells each text once, above the progress bar."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._noted: set[str] = set()

    def note(self, text: str) -> None:
        """Tell `text`, if it is new: it is no warning."""
        if text and text not in self._noted:
            self._noted.add(text)
            tqdm.write(text, file=sys.stderr)

    def add(self, text: str) -> None:
        """Tell `text`, if it is new."""
        if text in self.texts:
            return
        self.texts.append(text)
        if len(self.texts) <= PRINTED_WARNINGS:
            tqdm.write(f'warning: {text}', file=sys.stderr)
        elif len(self.texts) == PRINTED_WARNINGS + 1:
            tqdm.write('warning: more of them are in summary.json', file=sys.stderr)


class Steps:
    """The tracker over the clouds of a bag, one by one; publishes into a bag what the node would.

    Parameters
    ----------
    tracker : Tracker
    stream : StreamConfig
    writer : BagWriter or None
    warnings : Warnings
    look : TrackView or None
        Shows each scan.

    Raises
    ------
    InputError
        A base frame without its transformation: there is no tf2 here to ask.
    """

    def __init__(self, tracker: Tracker, stream: StreamConfig, writer: BagWriter | None,
                 warnings: Warnings, look: 'TrackView | None' = None) -> None:
        if stream.base_frame and not stream.T_base_sensor:
            raise InputError(f'base_frame = {stream.base_frame!r}: the replay has no tf2 to look '
                             'it up, so it needs T_base_sensor')
        self._T_base_sensor = (parse_transform(stream.T_base_sensor, 'T_base_sensor')
                               if stream.T_base_sensor else None)
        self._tracker = tracker
        self._stream = stream
        self._writer = writer
        self._warnings = warnings
        self._look = look
        self._odom_frame = OdomFrame()

    def take(self, cloud: RecordedCloud) -> Row:
        """Track one cloud; a broken one is a row without a pose."""
        stamp_ns, label_field = cloud.bag_time_ns, self._stream.label_field
        start = time.perf_counter()
        try:
            stamp_ns, frame, message = cloud.read()
            self._warnings.note(choice_in_words(message, label_field))
            scan = decode(message, label_field_of(message, label_field))
            tracked = self._tracker.track(scan, stamp_ns)
        except InputError as error:
            self._warnings.add(f'scan at {stamp_ns * 1e-9:.3f} s left out: {error}')
            return Row(stamp_ns, str(error))
        seconds = time.perf_counter() - start
        if self._look:
            self._look.show(scan, tracked)
        for text in tracked.warnings:
            self._warnings.add(text)
        if not tracked.success:
            self._warnings.add(f'scan at {stamp_ns * 1e-9:.3f} s has no pose: {tracked.reason}')
        placed = self._odom_frame.place(tracked, self._T_base_sensor)
        if self._writer:
            for topic, result in self._results(self._writer.types, tracked, placed, frame):
                self._writer.write(topic, result, cloud.bag_time_ns)
        step = tracked.registration
        return Row(stamp_ns, tracked.reason, placed.T_odom_sensor, tracked.restarted,
                   None if step is None else int(step.inliers.sum()),
                   math.nan if step is None else step.confidence, seconds, tracked.timings)

    def _results(self, types: messages.Types, tracked: TrackedScan, placed: TrackedScan,
                 frame: str) -> Iterator[tuple[str, Any]]:
        """Yield what the node would publish: topic and message."""
        odom, sensor = self._stream.odom_frame, self._stream.sensor_frame or frame_id(frame)
        if tracked.success:
            yield '/odometry', messages.odometry(types, placed, odom,
                                                 self._stream.base_frame or sensor)
            yield '/pose', messages.pose_stamped(types, placed, odom)
            if tracked.T_reference_sensor is not None:
                yield '/relative_pose', messages.relative_pose(types, tracked, sensor)
        yield '/correspondences', messages.correspondence_markers(
            types, self._odom_frame.of_sensor(tracked), odom)
