"""The way of a scan through the tracker, on one screen."""
from dataclasses import replace
import logging

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.prediction_check import check_prediction
from ..core.preprocessing import preprocess
from ..core.registration import register
from ..core.scan.scan import SemanticScan
from ..core.verdict.result import Registration
from .choice import choose
from .choice import is_likely
from .choice import or_unknown
from .choice import refined
from .choice import relocalised
from .choice import Step
from .config import TrackerConfig
from .covariance import PoseCovariance
from .deskewing import by_expected_motion
from .deskewing import by_step
from .deskewing import is_skewed
from .deskewing import LONGEST_STEP_S
from .deskewing import Sweep
from .deskewing import with_frames
from .keyframe_selection import is_keyframe
from .keyframe_selection import is_new_place
from .keyframe_selection import overlap
from .keyframes import Keyframe
from .keyframes import Keyframes
from .motion import Motion
from .result import State
from .result import TrackedScan
from .result import without_pose
from .scan_at_work import ScanAtWork
from .stamps import Arrival
from .stamps import Stamps

Array = NDArray[np.float64]

LOGGER = logging.getLogger('sgor_ros')


class Tracker:
    """Registers each scan to a reference and composes the poses.

    Live node and replay drive this same object. A scan that cannot be registered has no pose; the
    next bridges the gap, and after many the track is lost. All the while other keyframes are
    tried in turns, those of earlier tracks too: where one is recognised, its track goes on. Lost
    for long, a new track begins, with a number of its own.
    """

    _reference: Keyframe | None

    def __init__(self, config: SgorConfig | None = None,
                 tracker_config: TrackerConfig | None = None) -> None:
        self.config = SgorConfig.given(config)
        self.tracker_config = TrackerConfig.given(tracker_config)
        self._late = 0
        self._tracks = 0
        self._ids = 0
        self._up: Array | None = None    # for the last scan, in its sensor's frame
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next scan is the origin of a new track."""
        self._stamps = Stamps()
        self._forget()

    @property
    def reference(self) -> Keyframe | None:
        """What the next scan is registered to: the last scan itself where it became a keyframe."""
        return self._reference

    def begin_track(self) -> None:
        """Let the next scan be the origin of a new track; earlier ones can still come back."""
        if self._reference is not None:
            self._keyframes.keep(self._reference, self.tracker_config.max_keyframes)
        self._reference = None

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
            self._forget()
        before = vars(self).copy()
        try:
            return self._process(scan, stamp_ns, warnings)
        except InputError:
            raise
        except Exception as error:
            # a robot depends on this process: no cloud may end it, and the next one is another
            LOGGER.exception('scan at %.3f s: fault of the program', stamp_ns * 1e-9)
            vars(self).update(before)
            return self._fault(stamp_ns, warnings, error)

    def _process(self, scan: SemanticScan, stamp_ns: int, warnings: list[str]) -> TrackedScan:
        """Find the pose of a scan that is on time."""
        middle_s = None if scan.times is None else float(scan.times.mean())
        scan, frame_covariance = by_expected_motion(scan, self._sweep, self.tracker_config)
        prepared = preprocess(
            scan, self.config,
            scale_before=self._reference.prepared.scale if self._reference else None,
            up_before=self._up)
        self._up = prepared.ground.normal if prepared.ground else None
        if frame_covariance is not None:
            prepared = replace(prepared, frame_covariance=frame_covariance)
        new = ScanAtWork(prepared, stamp_ns, [*warnings, *prepared.warnings],
                         dict(prepared.timings), middle_s=middle_s,
                         deskewed_by=self._sweep.twist if self._sweep else None)
        if self._reference is None:
            return self._begin(new)
        step = self._predicted_step(new) or self._step(new, self._reference)
        if isinstance(step, Step):
            step = self._deskewed_again(new, step)
            # in a new track each new place is a chance to find back to an old track
            new_place = is_new_place(step.T_reference_sensor, self._reference,
                                     self._last_keyframe(), self.tracker_config)
            older = self._relocalise(new, 1, earlier=True) if new_place else None
            return self._accept(new, older or step)
        other = self._relocalise(new, self.tracker_config.retries)
        return self._fail(new, step) if other is None else self._accept(new, other)

    def _forget(self) -> None:
        self._keyframes = Keyframes()
        self._reference = None
        self._up = None
        self._motion = Motion.unknown(0, np.eye(4), np.zeros((6, 6)), self.tracker_config)
        self._track_id = self._tracks
        self._failures = 0
        self._registered = False
        self._sweep: Sweep | None = None    # the last one with a pose, of scans with times

    def _drop(self, stamp_ns: int) -> TrackedScan:
        self._late += 1
        return without_pose(
            stamp_ns, State.LATE, f'stamp {stamp_ns * 1e-9:.3f} s is not after the last, '
            f'{(self._stamps.newest_ns or 0) * 1e-9:.3f} s', self._track_id, self._failures,
            self._late)

    def _fault(self, stamp_ns: int, warnings: list[str], error: Exception) -> TrackedScan:
        """Count a scan that an exception ended as one without a pose."""
        self._failures += 1
        lost = self._failures >= self.tracker_config.max_failures
        return without_pose(
            stamp_ns, State.LOST if lost else State.FAILED,
            f'fault of the program: {type(error).__name__}: {error}', self._track_id,
            self._failures, self._late, tuple(warnings))

    def _begin(self, new: ScanAtWork) -> TrackedScan:
        """Make the scan the origin of a new track, if something can be registered to it."""
        keypoints = len(new.prepared.features.points)
        if keypoints < self.tracker_config.min_keypoints:
            return self._fail(new, f'only {keypoints} keypoints to start from')
        self._tracks += 1
        self._track_id = self._tracks
        self._failures = 0
        self._registered = False
        self._sweep = None
        origin = PoseCovariance.origin()
        self._reference = self._keyframe(new, np.eye(4), origin)
        self._motion = Motion.unknown(new.stamp_ns, np.eye(4), np.zeros((6, 6)),
                                      self.tracker_config)
        self._keyframes.add(self._reference, self.tracker_config.max_keyframes)
        c = self.tracker_config
        if c.predict_first and self.config.hypothesis_radius == 0:
            new.warnings.append('predict_first: SGOR registers every scan all the same, for '
                                'hypothesis_radius is 0')
        return replace(
            new.result(State.NEW_TRACK, self._track_id, self._failures, self._late), success=True,
            T_odom_sensor=np.eye(4), covariance=origin.pose, keyframe=True,
            keyframe_id=self._reference.id, restarted=True)

    def _keyframe(self, new: ScanAtWork, T_odom_sensor: Array, covariance: PoseCovariance | None
                  ) -> Keyframe:
        """Make a scan one that others can be registered to."""
        self._ids += 1
        return Keyframe(self._ids, new.prepared, new.stamp_ns, self._track_id, T_odom_sensor,
                        covariance)

    def _last_keyframe(self) -> Keyframe | None:
        return self._keyframes.last(self._track_id)

    def _predicted_step(self, new: ScanAtWork) -> Step | None:
        """Test the predicted motion; return a step if it convinces, and None if SGOR is to run.

        That follows a scan that stood for itself, as long as no keyframe is to be made: what all
        later scans are registered to has been found without any prediction.
        """
        c = self.tracker_config
        motion = self._motion.before(new.stamp_ns, c)
        assert self._reference is not None
        prediction = motion.predict(new.stamp_ns, c)
        T = prediction.T_reference_sensor
        if not (c.predict_first and self.config.hypothesis_radius > 0 and self._registered
                and not self._failures and prediction.is_narrow() and self._keeps_keyframe(T)):
            return None
        self._reference = self._reference.ready(self.config)
        if new.prepared.scale != self._reference.prepared.scale:
            return None
        config = self.config
        if config.min_confidence < c.min_prediction_confidence:
            config = config.replace(min_confidence=c.min_prediction_confidence)
        found = check_prediction(new.prepared, self._reference.prepared, T, config)
        new.spent(found.timings)
        if (not found.success or found.T_target_source is None
                or not self._keeps_keyframe(found.T_target_source, found)
                or not is_likely(found, prediction)):
            return None
        step = self._with_frames(Step(found.T_target_source, found.covariance,
                                      found.correlated_error), new, self._reference)
        if motion.impossible(new.stamp_ns, step.T_reference_sensor, c):
            return None
        new.registration, new.reference, new.confirmed = found, self._reference, True
        return step

    def _keeps_keyframe(self, T_reference_sensor: Array, found: Registration | None = None
                        ) -> bool:
        """Whether a scan that was found there makes no new keyframe."""
        assert self._reference is not None
        last, c = self._last_keyframe(), self.tracker_config
        return not (is_new_place(T_reference_sensor, self._reference, last, c)
                    or is_keyframe(T_reference_sensor, found, self._reference, last, c))

    def _step(self, new: ScanAtWork, keyframe: Keyframe) -> Step | str:
        """Register a scan to a keyframe; return the step to it, or why there is none."""
        keyframe = keyframe.ready(self.config)
        found = register(new.prepared, keyframe.prepared, self.config)
        new.spent(found.timings)
        assert self._reference is not None
        motion = self._motion.before(new.stamp_ns, self.tracker_config)
        if keyframe.id == self._reference.id:
            self._reference = keyframe
            step = choose(found, motion, new.stamp_ns, self.tracker_config,
                          lambda placement: refined(placement, new.prepared, keyframe.prepared,
                                                    self.config))
        else:
            T_reference_keyframe = (
                None if keyframe.track_id != self._track_id else
                se3.inverse(self._reference.T_odom_sensor) @ keyframe.T_odom_sensor)
            step = relocalised(found, T_reference_keyframe, motion, new.stamp_ns,
                               self.tracker_config)
        if new.registration is None or not isinstance(step, str):
            new.registration, new.reference = found, keyframe
        return step if isinstance(step, str) else self._with_frames(step, new, keyframe)

    def _with_frames(self, step: Step, new: ScanAtWork, keyframe: Keyframe) -> Step:
        """Return a step that knows what is left of the bend of both scans."""
        return step if step.covariance is None else replace(step, covariance=with_frames(
            step.covariance, step.T_reference_sensor, new.prepared.frame_covariance,
            keyframe.prepared.frame_covariance))

    def _deskewed_again(self, new: ScanAtWork, step: Step) -> Step:
        """Register once more without the bend where nobody knew the motion before this step."""
        reference = new.reference
        assert reference is not None
        seconds = (new.stamp_ns - reference.stamp_ns) * 1e-9
        if not (is_skewed(new.prepared) and is_skewed(reference.prepared)
                and reference is self._reference
                and 0 < seconds < LONGEST_STEP_S):
            return step
        bent, registration = new.prepared, new.registration
        assert registration is not None
        twist = se3.log(step.T_reference_sensor) / seconds
        covariance = or_unknown(registration.covariance) / seconds**2
        new.prepared = by_step(bent, twist, covariance)
        again = self._step(new, replace(
            reference, prepared=by_step(reference.prepared, twist, covariance)))
        if isinstance(again, str):
            new.prepared, new.registration, new.reference = bent, registration, reference
            self._reference = reference
            return step
        new.deskewed_by = twist
        self._sweep = Sweep.of(reference.track_id, reference.stamp_ns, reference.T_odom_sensor,
                               np.zeros((6, 6)), twist, new.middle_s or 0.0)
        self._keyframes.renew(self._reference)
        return again

    def _relocalise(self, new: ScanAtWork, tries: int, *, earlier: bool = False) -> Step | None:
        """Try other keyframes, or those of earlier tracks; each scan a few, in turns."""
        assert self._reference is not None
        for keyframe in self._keyframes.in_turns(tries, self._reference,
                                                 self._track_id if earlier else None):
            if not isinstance(step := self._step(new, keyframe), str):
                return step
        return None

    def _accept(self, new: ScanAtWork, step: Step) -> TrackedScan:
        """Give a registered scan its pose, and decide what the next is registered to."""
        keyframe, T = new.reference, step.T_reference_sensor
        assert keyframe is not None
        if keyframe.track_id != self._track_id:
            new.warnings.append(f'track {keyframe.track_id} is found again and goes on')
        if step.note:
            new.warnings.append(step.note)
        moving = self._move(new, keyframe, step)
        assert new.registration is not None
        self._reference, self._track_id, self._failures = keyframe, keyframe.track_id, 0
        self._registered = new.registration.success
        T_odom_sensor = keyframe.T_odom_sensor @ T
        if new.middle_s is not None:
            sweep = Sweep.of(self._track_id, new.stamp_ns, T_odom_sensor,
                             or_unknown(new.registration.covariance), new.deskewed_by,
                             new.middle_s)
            self._sweep = self._sweep.then(sweep) if self._sweep else sweep
        covariance = None
        if keyframe.covariance is not None and step.covariance is not None:
            covariance = keyframe.covariance.then(keyframe.T_odom_sensor, T, step.covariance,
                                                  step.correlated_error)
        state = State.TRACKING if step.fused is None else State.DEGENERATE
        result = replace(
            new.result(state, self._track_id, self._failures, self._late), success=True,
            T_odom_sensor=T_odom_sensor,
            covariance=None if covariance is None else covariance.pose,
            twist=self._motion.twist if moving else None,
            twist_covariance=(self._motion.twist_covariance
                              if moving and step.covariance is not None else None),
            T_reference_sensor=T, reference_covariance=step.covariance)
        c = self.tracker_config
        kept = is_keyframe(T, new.registration, self._reference, self._last_keyframe(), c)
        if keyframe.first_overlap is None:
            self._reference = replace(self._reference, first_overlap=overlap(new.registration))
        if (len(new.prepared.features.points) < c.min_keypoints
                or (not kept and c.mode == 'keyframe')):
            return result
        self._reference = self._keyframe(new, T_odom_sensor, covariance)
        self._motion = self._motion.at_new_reference()
        if kept:
            self._keyframes.add(self._reference, self.tracker_config.max_keyframes)
        return replace(result, keyframe=True, keyframe_id=self._reference.id)

    def _move(self, new: ScanAtWork, keyframe: Keyframe, step: Step) -> bool:
        """Take in the motion of a step; return whether the velocity is known."""
        assert self._reference is not None
        covariance = or_unknown(step.covariance)
        before = self._motion
        if step.fused is not None:
            self._motion = step.fused
        elif (keyframe.id == self._reference.id and before.stamp_ns < new.stamp_ns
              and self._failures < self.tracker_config.max_failures):
            self._motion = before.measured(new.stamp_ns, step.T_reference_sensor, covariance)
        else:
            self._motion = Motion.unknown(new.stamp_ns, step.T_reference_sensor, covariance,
                                          self.tracker_config)
            return False
        return True

    def _fail(self, new: ScanAtWork, reason: str) -> TrackedScan:
        """Give no pose; the keyframes stay, until after long a new track begins."""
        config = self.tracker_config
        self._failures += 1
        lost = self._failures >= config.max_failures
        seconds = self._motion.seconds_to(new.stamp_ns)
        if (lost and self._reference is not None and seconds > config.new_track_after
                and len(new.prepared.features.points) >= config.min_keypoints):
            self._keyframes.keep(self._reference, config.max_keyframes)
            new.warnings.append(f'lost for {seconds:.1f} s: a new track begins')
            return self._begin(new)
        if self._failures == config.max_failures:
            new.warnings.append(f'{self._failures} scans in a row without a pose: lost')
        return replace(new.result(State.LOST if lost else State.FAILED, self._track_id,
                                  self._failures, self._late), reason=reason)
