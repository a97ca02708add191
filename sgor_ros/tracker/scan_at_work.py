"""The scan that the tracker is working on, and what is known of it so far."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.prepared_scan import PreparedScan
from ..core.verdict.result import Registration
from .keyframes import Keyframe
from .result import State
from .result import TrackedScan


@dataclass(eq=False)
class ScanAtWork:
    """The scan at work: what it has become so far."""

    prepared: PreparedScan
    stamp_ns: int
    warnings: list[str]
    timings: dict[str, float]
    registration: Registration | None = None
    reference: Keyframe | None = None
    confirmed: bool = False
    middle_s: float | None = None
    """Of its sweep since its stamp; None where its points have no times."""
    deskewed_by: NDArray[np.float64] | None = None
    """Twist, m/s and rad/s; None where it is as it came."""

    def spent(self, timings: dict[str, float]) -> None:
        """Add the seconds of stages."""
        for stage, seconds in timings.items():
            self.timings[stage] = self.timings.get(stage, 0.0) + seconds

    def result(self, state: State, track_id: int, failures: int, late: int) -> TrackedScan:
        """Return what is known before it has a pose."""
        return TrackedScan(
            self.stamp_ns, False, '', None, None, None, self.registration,
            None if self.reference is None else self.reference.stamp_ns, False, False,
            tuple(self.warnings), self.timings, state, track_id, failures=failures, late=late,
            confirmed=self.confirmed,
            reference_id=None if self.reference is None else self.reference.id)
