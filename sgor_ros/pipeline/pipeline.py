"""A scan in, everything that is published of it out: one implementation for node and replay."""
from dataclasses import replace
import logging
import time

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.scan.deskewing import deskewed
from ..core.scan.scan import SemanticScan
from ..io.frames import frame_id
from ..io.sequence import StampedScan
from ..io.stream_config import StreamConfig
from ..mapping import Map
from ..mapping import Mapper
from ..tracker import TrackedScan
from ..tracker import Tracker
from .extrinsic import Extrinsic
from .extrinsic import Mount
from .outcome import Outcome
from .published_frames import PublishedFrames
from .query import Query
from .scan_messages import Message
from .scan_messages import ScanMessages
from .sinks import MessageSink

LOGGER = logging.getLogger('sgor_ros')


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
        self._mount = Mount(extrinsic, config)
        self._frames = PublishedFrames(self.tracker, self.mapper, self._mount)
        self._messages = None if sink is None else ScanMessages(
            sink, config, self._frames, self.mapper, inverted_tf=inverted_tf)
        self._frame = ''    # of the last scan
        self._hint: NDArray[np.float64] | None = None

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

    def _outcome(self, scan: StampedScan, frame: str) -> tuple[Outcome, list[Message]]:
        """Return what became of a scan, and its messages by topic."""
        begin = time.perf_counter()
        points = scan.read()
        with_up = self._mount.of(points, scan.stamp_ns, frame)
        self._give_hint(scan.stamp_ns, frame)
        tracked = self._track(with_up, scan.stamp_ns, frame)
        seconds = time.perf_counter() - begin
        placed = self._frames.place(tracked, frame)
        published = [] if self._messages is None else list(
            self._messages.of(tracked, placed, frame))
        reason, T_odom_child = ((placed, None) if isinstance(placed, str)
                                else (tracked.reason, placed.T_odom_sensor))
        return Outcome(scan.stamp_ns, frame, reason, points, tracked, T_odom_child,
                       seconds), published

    def _give_hint(self, stamp_ns: int, frame: str) -> None:
        """Hand the hint on to the mapper, as a pose of the sensor in its frame."""
        if self._hint is None or self.mapper is None:
            return
        T = self._frames.sensor_in_mapper(self._hint, stamp_ns, frame)
        if T is not None:
            self.mapper.hint(T)
            self._hint = None

    def _track(self, scan: SemanticScan, stamp_ns: int, frame: str) -> TrackedScan:
        tracked = (self.mapper or self.tracker).track(scan, stamp_ns)
        before, self._frame = self._frame, frame
        if before in ('', frame) or tracked.restarted:
            return tracked
        # the pose is right all the same, the motion is not that of one sensor
        return replace(tracked, twist=None, twist_covariance=None, warnings=(
            *tracked.warnings, f'the frame of the clouds changed from {before} to {frame}'))

    def begin_at(self, T_odom_child: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        """Let the next track begin at a pose, (4, 4) with (6, 6), of the frame it publishes."""
        self._frames.odom.begin_at(T_odom_child, covariance)

    def begin_in(self, known: Map) -> None:
        """Let the mapper go on in another map; odom goes on.

        Raises
        ------
        InputError
            Its settings do not go with those of the mapper.
        """
        assert self.mapper is not None, 'a mapper has a map'
        self.mapper.begin_in(known)
        self._frames.odom.T_map_mapper = known.T_base_sensor

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
        mount = self._mount.T_base_sensor(outcome.stamp_ns, outcome.frame)
        if isinstance(mount, str):
            raise InputError(mount)
        scan = self._mount.of(outcome.scan, outcome.stamp_ns, outcome.frame)
        if outcome.tracked is not None and outcome.tracked.twist is not None:
            scan = deskewed(scan, outcome.tracked.twist)
        return Query(scan, outcome.stamp_ns, self._config.base_frame or outcome.frame,
                     self._frames.T_map_mapper(mount), mount)
