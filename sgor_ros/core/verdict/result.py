"""What `register` found out: `Status`, `Placement`, `Registration`."""
from collections.abc import Callable
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
from enum import StrEnum
from typing import Any
from typing import Literal
from typing import TYPE_CHECKING
import warnings

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..common.checks import as_numbers
from ..common.se3 import angle
from ..common.settings import InputError
from ..scan.ground import Ground
from ..scoring.pose_scoring import PoseScore
from ..solver.solution import Solution
from .notebook import html_of

Array = NDArray[np.float64]


class Status(StrEnum):
    """The verdict on a registration; only one of them may be used as it is."""

    REGISTERED = 'registered'
    """The clouds bear the transformation out, alone, and hold it in all six directions."""
    AMBIGUOUS = 'ambiguous'
    """Other placements explain the clouds as well: see `Registration.alternatives`."""
    DEGENERATE = 'degenerate'
    """Right but for the directions in `Registration.degenerate`, along which the clouds slide."""
    REFUSED = 'refused'
    """There is a candidate, and the clouds do not bear it out."""
    NO_SOLUTION = 'no solution'
    """There is not even a candidate."""


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
    score : PoseScore or None
        None where nobody asked.
    """

    T_target_source: Array
    covariance: Array | None
    degenerate: Array
    score: PoseScore | None = None

    def __repr__(self) -> str:
        return f'Placement({_moved(self.T_target_source)})'


@dataclass(frozen=True, eq=False, repr=False)
class Registration:
    """What `register` found out.

    Attributes
    ----------
    status : Status
    reason : str
        Why it is not registered, in words; empty where it is.
    T_target_source : (4, 4) float64 or None
        Maps source points into the target. None only where the status is NO_SOLUTION; where it is
        another but REGISTERED, a candidate to look at and not to use.
    source_points, target_points : (K, 3) float64
        The correspondences, metres.
    inliers : (K,) bool
        Those that agree with the transformation.
    confidence : float
        0 to 1: what the clouds say for the transformation, divided among the alternatives.
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2. Along a degenerate
        direction its variance is what is really unknown. None without a refinement on the clouds,
        and where a direction is not observed at all.
    correlated_error : (6, 6) float64 or None
        Square root S of that part of the covariance, S S^T, that errs alike in the steps of a
        drive, so that it adds up instead of averaging out. None with the covariance's reasons.
    degenerate : (K, 6) float64
        Independent unit directions (x, y, z, rotation about x, y, z) in the target frame along
        which the clouds slide on each other. Not empty only where the status is DEGENERATE: the
        other directions are good. Where it is AMBIGUOUS those of each alternative tell.
    alternatives : tuple of Placement
        The other placements that the clouds cannot rule out (perceptual aliasing), best first.
        Not empty only where the status is AMBIGUOUS.
    score : PoseScore or None
        Overlap and free-space violations; None without a candidate, and without clouds.
    solution : Solution or None
        What the solver did; None where a prediction was checked without it.
    source_ground, target_ground : Ground or None
        None without a ground plane, and without clouds.
    warnings : tuple of str
        What was odd about the scans, in words.
    timings : dict of str to float
        Stage to seconds.
    """

    status: Status
    reason: str
    T_target_source: Array | None
    source_points: Array
    target_points: Array
    inliers: NDArray[np.bool_]
    confidence: float = 0.0
    covariance: Array | None = None
    correlated_error: Array | None = None
    degenerate: Array = field(default_factory=lambda: np.empty((0, 6)))
    alternatives: tuple[Placement, ...] = ()
    score: PoseScore | None = None
    solution: Solution | None = None
    source_ground: Ground | None = None
    target_ground: Ground | None = None
    warnings: tuple[str, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether the transformation may be used: the status is REGISTERED."""
        return self.status is Status.REGISTERED

    def transform(self, points: ArrayLike) -> Array:
        """Return points of the source, (N, 3) or (3,), in the frame of the target, metres.

        Raises
        ------
        InputError
            It is not registered, or other shapes.
        """
        T = self.T_target_source
        if not self.success or T is None:
            raise InputError(f'transform: not registered: {self.reason}')
        array = as_numbers(points, 'points')
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise InputError(f'points: expected an (N, 3) array, got shape {array.shape}')
        moved: Array = array.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
        return moved

    def to_dict(self) -> dict[str, Any]:
        """Return what there is to keep of it as numbers, texts and lists, as JSON has them.

        Correspondences are only counted. A transformation that was refused is left out, for it is
        nothing to build on; one of several, or one that slides, may be.
        """
        T, covariance = self.T_target_source, self.covariance
        usable = self.success or len(self.degenerate) > 0 or bool(self.alternatives)
        return {
            'success': self.success, 'status': self.status.value, 'reason': self.reason,
            'confidence': self.confidence,
            'T_target_source': T.tolist() if T is not None and usable else None,
            'covariance': None if covariance is None else covariance.tolist(),
            'degenerate': self.degenerate.tolist(),
            'alternatives': [other.T_target_source.tolist() for other in self.alternatives],
            'correspondences': len(self.inliers), 'inliers': int(self.inliers.sum()),
            'score': None if self.score is None else asdict(self.score),
            'warnings': list(self.warnings), 'timings_s': dict(self.timings)}

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        return html_of(self)

    def __getattr__(self, name: str) -> Any:
        """Answer to the names of version 0.2, with a warning."""
        if name not in _RENAMED:
            raise AttributeError(f'{type(self).__name__!r} object has no attribute {name!r}')
        now, found = _RENAMED[name]
        warnings.warn(f'Registration.{name} is {now} now', DeprecationWarning, stacklevel=2)
        return found(self)

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


if TYPE_CHECKING:
    class Registered(Registration):
        """What `success` means to a type checker: there is a transformation."""

        T_target_source: Array

        @property
        def success(self) -> Literal[True]:
            """It may be used."""

    class NotRegistered(Registration):
        """The other case."""

        @property
        def success(self) -> Literal[False]:
            """It may not be used."""

    Result = Registered | NotRegistered
else:
    Result = Registration


_RENAMED: dict[str, tuple[str, Callable[[Registration], Any]]] = {
    'systematic': ('correlated_error', lambda r: r.correlated_error),
    'evidence': ('score', lambda r: {} if r.score is None else {
        'agree': r.score.overlap, 'contradict': r.score.violations, **asdict(r.score)}),
    'hypotheses': ('solution.hypotheses', lambda r: (
        np.empty((0, 4, 4)) if r.solution is None else r.solution.hypotheses)),
    'passed_ground_check': ('solution.passed_ground_check', lambda r: (
        np.empty(0, np.bool_) if r.solution is None else r.solution.passed_ground_check)),
    'hypothesis_scores': ('solution.hypothesis_scores', lambda r: (
        np.empty(0) if r.solution is None else r.solution.hypothesis_scores)),
    'best_hypothesis': ('solution.best_hypothesis', lambda r: (
        -1 if r.solution is None else r.solution.best_hypothesis))}


def _moved(T: Array) -> str:
    return f'moved {np.linalg.norm(T[:3, 3]):.2f} m, turned {np.degrees(angle(T[:3, :3])):.1f} deg'
