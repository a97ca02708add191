"""The step from a keyframe to a scan: predicted and tested, or found by SGOR."""
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.prediction_check import check_prediction
from ..core.registration import register
from ..core.verdict.result import Registration
from .choice import choose
from .choice import is_likely
from .choice import or_unknown
from .choice import refined
from .choice import relocalised
from .choice import Step
from .deskewing import by_step
from .deskewing import is_skewed
from .deskewing import LONGEST_STEP_S
from .deskewing import Sweep
from .deskewing import with_frames
from .keyframe_selection import is_keyframe
from .keyframe_selection import is_new_place
from .keyframes import Keyframe
from .scan_at_work import ScanAtWork
from .track import Track

Array = NDArray[np.float64]


class ScanRegistration:
    """Registers a scan to keyframes of a track that has begun.

    Parameters
    ----------
    track : Track
        Its reference is prepared anew where settings have changed, or deskewed where the motion is
        known only now.
    new : ScanAtWork
        Keeps the registration that counts, and to which keyframe it is.
    """

    def __init__(self, track: Track, new: ScanAtWork) -> None:
        self._track, self._new = track, new

    @property
    def _reference(self) -> Keyframe:
        assert self._track.reference is not None, 'the track has begun'
        return self._track.reference

    def predicted(self) -> Step | None:
        """Test the predicted motion; return a step if it convinces, and None if SGOR is to run.

        That follows a scan that stood for itself, as long as no keyframe is to be made: what all
        later scans are registered to has been found without any prediction.
        """
        track, new, config, c = self._track, self._new, self._new.config, self._new.tracker_config
        motion = track.motion.before(new.stamp_ns, c)
        prediction = motion.predict(new.stamp_ns, c)
        T = prediction.T_reference_sensor
        if not (c.predict_first and config.hypothesis_radius > 0 and track.registered
                and not track.failures and prediction.is_narrow() and self._keeps_keyframe(T)):
            return None
        track.reference = reference = self._reference.ready(config)
        if new.prepared.scale != reference.prepared.scale:
            return None
        if config.min_confidence < c.min_prediction_confidence:
            config = config.replace(min_confidence=c.min_prediction_confidence)
        found = check_prediction(new.prepared, reference.prepared, T, config)
        new.spent(found.timings)
        if (not found.success or found.T_target_source is None
                or not self._keeps_keyframe(found.T_target_source, found)
                or not is_likely(found, prediction)):
            return None
        step = self._with_frames(Step(found.T_target_source, found.covariance,
                                      found.correlated_error), reference)
        if motion.impossible(new.stamp_ns, step.T_reference_sensor, c):
            return None
        new.registration, new.reference, new.confirmed = found, reference, True
        return step

    def registered(self, keyframe: Keyframe) -> Step | str:
        """Register the scan by SGOR; return the step from a keyframe, or why there is none."""
        track, new, c = self._track, self._new, self._new.tracker_config
        keyframe = keyframe.ready(new.config)
        found = register(new.prepared, keyframe.prepared, new.config)
        new.spent(found.timings)
        motion = track.motion.before(new.stamp_ns, c)
        if keyframe.id == self._reference.id:
            track.reference = keyframe
            step = choose(found, motion, new.stamp_ns, c,
                          lambda placement: refined(placement, new.prepared, keyframe.prepared,
                                                    new.config))
        else:
            T_reference_keyframe = (
                None if keyframe.track_id != track.id else
                se3.inverse(self._reference.T_odom_sensor) @ keyframe.T_odom_sensor)
            step = relocalised(found, T_reference_keyframe, motion, new.stamp_ns, c)
        if new.registration is None or not isinstance(step, str):
            new.registration, new.reference = found, keyframe
        return step if isinstance(step, str) else self._with_frames(step, keyframe)

    def deskewed_again(self, step: Step) -> Step:
        """Register once more without the bend where nobody knew the motion before this step."""
        track, new, reference = self._track, self._new, self._new.reference
        assert reference is not None
        seconds = (new.stamp_ns - reference.stamp_ns) * 1e-9
        if not (is_skewed(new.prepared) and is_skewed(reference.prepared)
                and reference is track.reference and 0 < seconds < LONGEST_STEP_S):
            return step
        bent, registration = new.prepared, new.registration
        assert registration is not None
        twist = se3.log(step.T_reference_sensor) / seconds
        covariance = or_unknown(registration.covariance) / seconds**2
        new.prepared = by_step(bent, twist, covariance)
        again = self.registered(replace(
            reference, prepared=by_step(reference.prepared, twist, covariance)))
        if isinstance(again, str):
            new.prepared, new.registration, new.reference = bent, registration, reference
            track.reference = reference
            return step
        new.deskewed_by = twist
        track.sweep = Sweep.of(reference.track_id, reference.stamp_ns, reference.T_odom_sensor,
                               np.zeros((6, 6)), twist, new.middle_s or 0.0)
        track.keyframes.renew(self._reference)
        return again

    def relocalised(self, tries: int) -> Step | None:
        """Try a few keyframes other than the reference, in turns from scan to scan."""
        return self._first_of(self._track.keyframes.in_turns(tries, self._reference))

    def of_an_earlier_track(self, step: Step) -> Step | None:
        """Try a keyframe of an earlier track where a step leads to a new place.

        Each new place is a chance to find back.
        """
        track = self._track
        if not is_new_place(step.T_reference_sensor, self._reference, track.last_keyframe,
                            self._new.tracker_config):
            return None
        return self._first_of(track.keyframes.in_turns(1, self._reference, track.id))

    def _first_of(self, keyframes: list[Keyframe]) -> Step | None:
        """Return the step to the first keyframe that there is one to."""
        for keyframe in keyframes:
            if not isinstance(step := self.registered(keyframe), str):
                return step
        return None

    def _keeps_keyframe(self, T_reference_sensor: Array, found: Registration | None = None
                        ) -> bool:
        """Whether a scan that was found there makes no new keyframe."""
        reference, last, c = self._reference, self._track.last_keyframe, self._new.tracker_config
        return not (is_new_place(T_reference_sensor, reference, last, c)
                    or is_keyframe(T_reference_sensor, found, reference, last, c))

    def _with_frames(self, step: Step, keyframe: Keyframe) -> Step:
        """Return a step that knows what is left of the bend of both scans."""
        return step if step.covariance is None else replace(step, covariance=with_frames(
            step.covariance, step.T_reference_sensor, self._new.prepared.frame_covariance,
            keyframe.prepared.frame_covariance))
