"""The way of a scan through the tracker, on one screen."""
from copy import copy
from dataclasses import replace
import logging

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.preprocessing import preprocess
from ..core.scan.scan import SemanticScan
from .config import TrackerConfig
from .deskewing import by_expected_motion
from .keyframes import Keyframe
from .result import State
from .result import TrackedScan
from .result import without_pose
from .scan_at_work import ScanAtWork
from .scan_registration import ScanRegistration
from .stamps import Arrival
from .stamps import Stamps
from .track import Track

LOGGER = logging.getLogger('sgor_ros')


class Tracker:
    """Registers each scan to a reference and composes the poses.

    Live node and replay drive this same object. A scan that cannot be registered has no pose; the
    next bridges the gap, and after many the track is lost. All the while other keyframes are
    tried in turns, those of earlier tracks too: where one is recognised, its track goes on. Lost
    for long, a new track begins, with a number of its own.
    """

    def __init__(self, config: SgorConfig | None = None,
                 tracker_config: TrackerConfig | None = None) -> None:
        self.config = SgorConfig.given(config)
        self.tracker_config = TrackerConfig.given(tracker_config)
        self._late = 0
        self._stamps = Stamps()
        self._track = Track(self.tracker_config)

    def reset(self) -> None:
        """Forget everything: the next scan is the origin of a new track."""
        self._stamps = Stamps()
        self._track.forget(self.tracker_config)

    @property
    def reference(self) -> Keyframe | None:
        """What the next scan is registered to: the last scan itself where it became a keyframe."""
        return self._track.reference

    def begin_track(self) -> None:
        """Let the next scan be the origin of a new track; earlier ones can still come back."""
        self._track.end(self.tracker_config)

    def track(self, scan: SemanticScan, stamp_ns: int) -> TrackedScan:
        """Take the next scan.

        Parameters
        ----------
        scan : SemanticScan
        stamp_ns : int
            Its stamp, nanoseconds. A scan that is not newer than the last is dropped; a clock
            that has gone back for good begins a new track.
        """
        before_ns = self._stamps.newest_ns
        arrival = self._stamps.judge(stamp_ns, self.tracker_config)
        if arrival is Arrival.LATE:
            return self._drop(stamp_ns)
        warnings = []
        if arrival is Arrival.ANEW:
            assert before_ns is not None
            warnings = [f'time ran backwards by {(before_ns - stamp_ns) * 1e-9:.3f} s: a new '
                        'track begins']
            self._track.forget(self.tracker_config)
        before = copy(self._track)
        try:
            return self._place(self._prepared(scan, stamp_ns, warnings))
        except InputError:
            raise
        except Exception as error:
            # a robot depends on this process: no cloud may end it, and the next one is another
            LOGGER.exception('scan at %.3f s: fault of the program', stamp_ns * 1e-9)
            self._track = before
            return self._fault(stamp_ns, warnings, error)

    def _prepared(self, scan: SemanticScan, stamp_ns: int, warnings: list[str]) -> ScanAtWork:
        """Deskew and prepare a scan that is on time."""
        track = self._track
        middle_s = None if scan.times is None else float(scan.times.mean())
        scan, frame_covariance = by_expected_motion(scan, track.sweep, self.tracker_config)
        prepared = preprocess(
            scan, self.config,
            scale_before=track.reference.prepared.scale if track.reference else None,
            up_before=track.up)
        track.up = prepared.ground.normal if prepared.ground else None
        if frame_covariance is not None:
            prepared = replace(prepared, frame_covariance=frame_covariance)
        return ScanAtWork(
            prepared, stamp_ns, self._late, self.config, self.tracker_config,
            [*warnings, *prepared.warnings], dict(prepared.timings), middle_s=middle_s,
            deskewed_by=track.sweep.twist if track.sweep else None)

    def _place(self, new: ScanAtWork) -> TrackedScan:
        """Find the pose of a prepared scan."""
        track = self._track
        if track.reference is None:
            return track.begin(new)
        registration = ScanRegistration(track, new)
        step = registration.predicted() or registration.registered(track.reference)
        if isinstance(step, str):
            other = registration.relocalised(self.tracker_config.retries)
            return track.fail(new, step) if other is None else track.accept(new, other)
        step = registration.deskewed_again(step)
        return track.accept(new, registration.of_an_earlier_track(step) or step)

    def _drop(self, stamp_ns: int) -> TrackedScan:
        """Count a scan that is late."""
        self._late += 1
        return without_pose(
            stamp_ns, State.LATE, f'stamp {stamp_ns * 1e-9:.3f} s is not after the last, '
            f'{(self._stamps.newest_ns or 0) * 1e-9:.3f} s', self._track.id,
            self._track.failures, self._late)

    def _fault(self, stamp_ns: int, warnings: list[str], error: Exception) -> TrackedScan:
        """Count a scan that an exception ended as one without a pose."""
        self._track.failures += 1
        lost = self._track.is_lost(self.tracker_config)
        return without_pose(
            stamp_ns, State.LOST if lost else State.FAILED,
            f'fault of the program: {type(error).__name__}: {error}', self._track.id,
            self._track.failures, self._late, tuple(warnings))
