"""The track: what the next scan is registered to, and how each scan changes that."""
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .choice import or_unknown
from .choice import Step
from .config import TrackerConfig
from .covariance import PoseCovariance
from .deskewing import Sweep
from .keyframe_selection import is_keyframe
from .keyframe_selection import overlap
from .keyframes import Keyframe
from .keyframes import Keyframes
from .motion import Motion
from .result import State
from .result import TrackedScan
from .scan_at_work import ScanAtWork

Array = NDArray[np.float64]


class Track:
    """What the tracker knows between two scans; each scan begins it, moves it on or fails.

    Attributes
    ----------
    reference : Keyframe or None
        What the next scan is registered to; None where it begins a new track.
    keyframes : Keyframes
        Those that are remembered, of earlier tracks too.
    motion : Motion
        Of the last scan with a pose, relative to the reference.
    id : int
        Of the track in whose frame poses are; 0 before the first.
    failures : int
        Scans in a row without a pose.
    registered : bool
        Whether the clouds alone gave the last pose (`Registration.success`): no choice among
        several placements, no directions that were predicted.
    sweep : Sweep or None
        The last one with a pose, of scans with times.
    up : (3,) float64 or None
        Which way is up in the last scan, in its sensor's frame.
    """

    def __init__(self, config: TrackerConfig) -> None:
        self._count = 0
        self._keyframe_count = 0
        self.forget(config)

    def forget(self, config: TrackerConfig) -> None:
        """Forget all but the numbers that were given."""
        self.reference: Keyframe | None = None
        self.keyframes = Keyframes()
        self.motion = Motion.unknown(0, np.eye(4), np.zeros((6, 6)), config)
        self.id = self._count
        self.failures = 0
        self.registered = False
        self.sweep: Sweep | None = None
        self.up: Array | None = None

    @property
    def last_keyframe(self) -> Keyframe | None:
        """The newest keyframe of the track that is remembered."""
        return self.keyframes.last(self.id)

    def end(self, config: TrackerConfig) -> None:
        """Let the next scan begin a new track; this one can still come back."""
        if self.reference is not None:
            self.keyframes.keep(self.reference, config.max_keyframes)
        self.reference = None

    def begin(self, new: ScanAtWork) -> TrackedScan:
        """Make the scan the origin of a new track, if something can be registered to it."""
        c = new.tracker_config
        if not new.can_be_registered_to:
            return self.fail(new, f'only {len(new.prepared.features.points)} keypoints to start '
                                  'from')
        self._count += 1
        self.id = self._count
        self.failures = 0
        self.registered = False
        self.sweep = None
        origin = PoseCovariance.origin()
        self.reference = self._keyframe(new, np.eye(4), origin)
        self.motion = Motion.unknown(new.stamp_ns, np.eye(4), np.zeros((6, 6)), c)
        self.keyframes.add(self.reference, c.max_keyframes)
        if c.predict_first and new.config.hypothesis_radius == 0:
            new.warnings.append('predict_first: SGOR registers every scan all the same, for '
                                'hypothesis_radius is 0')
        return replace(
            new.result(State.NEW_TRACK, self.id, self.failures), success=True,
            T_odom_sensor=np.eye(4), covariance=origin.pose, keyframe=True,
            keyframe_id=self.reference.id, restarted=True)

    def accept(self, new: ScanAtWork, step: Step) -> TrackedScan:
        """Give a registered scan its pose, and decide what the next is registered to."""
        keyframe, T = new.reference, step.T_reference_sensor
        assert keyframe is not None
        assert new.registration is not None
        if keyframe.track_id != self.id:
            new.warnings.append(f'track {keyframe.track_id} is found again and goes on')
        if step.note:
            new.warnings.append(step.note)
        moving = self._move(new, keyframe, step)
        self.reference, self.id, self.failures = keyframe, keyframe.track_id, 0
        self.registered = new.registration.success
        T_odom_sensor = keyframe.T_odom_sensor @ T
        self._add_sweep(new, T_odom_sensor)
        covariance = None
        if keyframe.covariance is not None and step.covariance is not None:
            covariance = keyframe.covariance.then(keyframe.T_odom_sensor, T, step.covariance,
                                                  step.correlated_error)
        state = State.TRACKING if step.fused is None else State.DEGENERATE
        result = replace(
            new.result(state, self.id, self.failures), success=True, T_odom_sensor=T_odom_sensor,
            covariance=None if covariance is None else covariance.pose,
            twist=self.motion.twist if moving else None,
            twist_covariance=(self.motion.twist_covariance
                              if moving and step.covariance is not None else None),
            T_reference_sensor=T, reference_covariance=step.covariance)
        if not self._becomes_reference(new, T, T_odom_sensor, covariance):
            return result
        return replace(result, keyframe=True, keyframe_id=self.reference.id)

    def fail(self, new: ScanAtWork, reason: str) -> TrackedScan:
        """Give no pose; the keyframes stay, until after long a new track begins."""
        c = new.tracker_config
        self.failures += 1
        seconds = self.motion.seconds_to(new.stamp_ns)
        if (self.is_lost(c) and self.reference is not None and seconds > c.new_track_after
                and new.can_be_registered_to):
            self.keyframes.keep(self.reference, c.max_keyframes)
            new.warnings.append(f'lost for {seconds:.1f} s: a new track begins')
            return self.begin(new)
        if self.failures == c.max_failures:
            new.warnings.append(f'{self.failures} scans in a row without a pose: lost')
        return replace(new.result(State.LOST if self.is_lost(c) else State.FAILED, self.id,
                                  self.failures), reason=reason)

    def is_lost(self, config: TrackerConfig) -> bool:
        """Whether too many scans in a row had no pose."""
        return self.failures >= config.max_failures

    def _keyframe(self, new: ScanAtWork, T_odom_sensor: Array, covariance: PoseCovariance | None
                  ) -> Keyframe:
        """Make a scan one that others can be registered to."""
        self._keyframe_count += 1
        return Keyframe(self._keyframe_count, new.prepared, new.stamp_ns, self.id, T_odom_sensor,
                        covariance)

    def _move(self, new: ScanAtWork, keyframe: Keyframe, step: Step) -> bool:
        """Take in the motion of a step; return whether the velocity is known."""
        assert self.reference is not None
        covariance = or_unknown(step.covariance)
        before = self.motion
        if step.fused is not None:
            self.motion = step.fused
        elif (keyframe.id == self.reference.id and before.stamp_ns < new.stamp_ns
              and not self.is_lost(new.tracker_config)):
            self.motion = before.measured(new.stamp_ns, step.T_reference_sensor, covariance)
        else:
            self.motion = Motion.unknown(new.stamp_ns, step.T_reference_sensor, covariance,
                                         new.tracker_config)
            return False
        return True

    def _add_sweep(self, new: ScanAtWork, T_odom_sensor: Array) -> None:
        """Take in where the sensor was in the middle of its sweep."""
        if new.middle_s is None:
            return
        assert new.registration is not None
        sweep = Sweep.of(self.id, new.stamp_ns, T_odom_sensor,
                         or_unknown(new.registration.covariance), new.deskewed_by, new.middle_s)
        self.sweep = self.sweep.then(sweep) if self.sweep else sweep

    def _becomes_reference(self, new: ScanAtWork, T_reference_sensor: Array, T_odom_sensor: Array,
                           covariance: PoseCovariance | None) -> bool:
        """Make the scan the reference of the next, where it is to be; remember keyframes."""
        c = new.tracker_config
        assert self.reference is not None
        assert new.registration is not None
        kept = is_keyframe(T_reference_sensor, new.registration, self.reference,
                           self.last_keyframe, c)
        if self.reference.first_overlap is None:
            self.reference = replace(self.reference, first_overlap=overlap(new.registration))
        if not new.can_be_registered_to or (not kept and c.mode == 'keyframe'):
            return False
        self.reference = self._keyframe(new, T_odom_sensor, covariance)
        self.motion = self.motion.at_new_reference()
        if kept:
            self.keyframes.add(self.reference, c.max_keyframes)
        return True
