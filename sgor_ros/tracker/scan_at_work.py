"""The scan that the tracker is working on, and what is known of it so far."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.config import SgorConfig
from ..core.prepared_scan import PreparedScan
from ..core.verdict.result import Registration
from .config import TrackerConfig
from .keyframes import Keyframe
from .result import State
from .result import TrackedScan


@dataclass(eq=False)
class ScanAtWork:
    """The scan at work: what it has become so far, and the settings that hold for it.

    Attributes
    ----------
    prepared : PreparedScan
    stamp_ns : int
    late : int
        Scans dropped before it because of their stamps.
    config : SgorConfig
    tracker_config : TrackerConfig
    warnings : list of str
    timings : dict of str to float
        Stage to seconds.
    registration : Registration or None
        That its pose comes from, or why it has none.
    reference : Keyframe or None
        What it was registered to.
    confirmed : bool
        Whether the clouds confirmed the motion that was predicted.
    middle_s : float or None
        Middle of its sweep since its stamp; None where its points have no times.
    deskewed_by : (6,) float64 or None
        Twist, m/s and rad/s; None where it is as it came.
    """

    prepared: PreparedScan
    stamp_ns: int
    late: int
    config: SgorConfig
    tracker_config: TrackerConfig
    warnings: list[str]
    timings: dict[str, float]
    registration: Registration | None = None
    reference: Keyframe | None = None
    confirmed: bool = False
    middle_s: float | None = None
    deskewed_by: NDArray[np.float64] | None = None

    @property
    def can_be_registered_to(self) -> bool:
        """Whether it has keypoints enough to be a keyframe."""
        return len(self.prepared.features.points) >= self.tracker_config.min_keypoints

    def spent(self, timings: dict[str, float]) -> None:
        """Add the seconds of stages."""
        for stage, seconds in timings.items():
            self.timings[stage] = self.timings.get(stage, 0.0) + seconds

    def result(self, state: State, track_id: int, failures: int) -> TrackedScan:
        """Return what is known before it has a pose."""
        return TrackedScan(
            self.stamp_ns, False, '', None, None, None, self.registration,
            None if self.reference is None else self.reference.stamp_ns, False, False,
            tuple(self.warnings), self.timings, state, track_id, failures=failures,
            late=self.late, confirmed=self.confirmed,
            reference_id=None if self.reference is None else self.reference.id)
