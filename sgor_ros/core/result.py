"""The way out: what `register` found out (`Registration`)."""
from dataclasses import dataclass
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from .common.se3 import angle
from .scan.ground import Ground


@dataclass(frozen=True, eq=False, repr=False)
class Placement:
    """One way to lay the source on the target that the clouds do not rule out.

    Attributes
    ----------
    T_target_source : (4, 4) float64
    covariance : (6, 6) float64 or None
        As of `Registration`.
    degenerate : (K, 6) float64
        As of `Registration`.
    evidence : dict of str to float
        What the clouds say of it.
    """

    T_target_source: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    degenerate: NDArray[np.float64]
    evidence: dict[str, float]

    def __repr__(self) -> str:
        return f'Placement({_moved(self.T_target_source)})'


@dataclass(frozen=True, eq=False, repr=False)
class Registration:
    """What `register` found out.

    Attributes
    ----------
    success : bool
    reason : str
        Why not, in words; empty on success.
    T_target_source : (4, 4) float64 or None
        Maps source points into the target; None where there is not even a candidate. Without
        success it is the refused candidate, to look at and not to use.
    confidence : float
        0 to 1: evidence that the transformation is right.
    source_points, target_points : (K, 3) float64
        The correspondences, metres.
    inliers : (K,) bool
        Those that agree with the transformation.
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2.
        Along a degenerate direction its variance is what is really unknown, metres or radians.
    systematic : (6, 6) float64 or None
        Square root S of that part of the covariance, S S^T, that errs alike in the steps of a
        drive, so that it adds up instead of averaging out.
    degenerate : (K, 6) float64
        Unit directions (x, y, z, rotation about x, y, z) in the target frame along which the
        clouds slide on each other (degeneracy). Never with `success`: the other directions are
        good, the transformation as a whole is not. Empty where all six are held, and where the
        result is ambiguous: then those of each alternative tell.
    alternatives : tuple of Placement
        The other placements that the clouds cannot rule out (perceptual aliasing), best first.
        Never with `success`.
    hypotheses : (H, 4, 4) float64
        Candidates of the groups, T_target_source.
    passed_ground_check : (H,) bool
        Which of them survived the first stage of verification.
    hypothesis_scores : (H,) float64
        What they were chosen by, the higher the better; minus infinity where the check failed.
    best_hypothesis : int
        Which of them won the second stage; -1 if none.
    source_ground, target_ground : Ground or None
    evidence : dict of str to float
        What the confidence was judged by.
    warnings : tuple of str
        What was odd about the scans, in words.
    timings : dict of str to float
        Stage to seconds.
    """

    success: bool
    reason: str
    T_target_source: NDArray[np.float64] | None
    source_points: NDArray[np.float64]
    target_points: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    confidence: float = 0.0
    covariance: NDArray[np.float64] | None = None
    systematic: NDArray[np.float64] | None = None
    degenerate: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 6)))
    alternatives: tuple[Placement, ...] = ()
    hypotheses: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4, 4)))
    passed_ground_check: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    hypothesis_scores: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    best_hypothesis: int = -1
    source_ground: Ground | None = None
    target_ground: Ground | None = None
    evidence: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return what a person wants to know first; the rest is in the attributes."""
        told = [('registered' if self.success else f'not registered: {self.reason}'),
                f'confidence {self.confidence:.2f}, {int(self.inliers.sum())} inliers of '
                f'{len(self.inliers)} correspondences']
        if self.T_target_source is not None:
            rows = np.array2string(self.T_target_source, precision=4, suppress_small=True,
                                   prefix='    T_target_source ')
            told += [f'{"" if self.success else "refused: "}{_moved(self.T_target_source)}',
                     f'T_target_source {rows}']
        told += [f'or else {_moved(other.T_target_source)}' for other in self.alternatives]
        told += [f'warning: {warning}' for warning in self.warnings]
        return 'Registration(' + '\n    '.join(told) + ')'


def _moved(T: NDArray[np.float64]) -> str:
    return f'moved {np.linalg.norm(T[:3, 3]):.2f} m, turned {np.degrees(angle(T[:3, :3])):.1f} deg'
