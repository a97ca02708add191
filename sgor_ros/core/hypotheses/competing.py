"""Competing hypotheses: the other poses of the source that the clouds may not rule out.

Where places repeat (perceptual aliasing) a wrong pose explains the clouds as well as the right
one, and no score of one of them alone can tell. So others are looked for far away (beyond the
paper): where the bird's-eye-view maps of both scans correlate for some shift and quarter turn,
among the hypotheses of the solver, and step by step along weak directions. Each is fitted by ICP
and scored at the same keypoints.

A competing pose is ruled out by free space: where it lays points into what the other sensor has
looked through, and the answer does not. What every pose explains, walls and road, tells none
apart.
"""
from dataclasses import dataclass
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..config import SgorConfig
from ..degeneracy.directions import DegenerateDirection
from ..degeneracy.directions import perturbed_poses
from ..degeneracy.directions import slid_back
from ..degeneracy.localizability import weak_directions
from ..degeneracy.perturbation_test import is_degenerate
from ..degeneracy.perturbation_test import measured
from ..degeneracy.perturbation_test import pushes_along
from ..icp.point_to_plane import icp
from ..index.scan_index import ScanIndex
from ..scoring.comparison import apart
from ..scoring.comparison import best_supported
from ..scoring.comparison import differ
from ..scoring.comparison import exclusive_violations
from ..scoring.comparison import ruled_out
from ..scoring.pose_scoring import AGREES
from ..scoring.pose_scoring import pose_score
from ..scoring.pose_scoring import score_keypoints
from .map_correlation import correlate_maps
from .weak_direction_search import search_weak_directions

Array = NDArray[np.float64]

FROM_SOLVER = 6
"""Poses taken from the hypotheses of the solver."""
WIDE, NARROW = 3, 4
"""Rounds of ICP for each pose, with partners up to twice and once the maximum distance."""
LATE = 10
"""Rounds of either kind for the few that nothing has ruled out by then."""
FEW, MANY = 250, 1000
"""Keypoints of each scan asked first, and where that does not rule a pose out."""
LEVEL = np.cos(np.radians(10.0))
"""Least cosine of the ground normals under a pose: slopes and their estimates included."""


@dataclass(frozen=True, eq=False)
class HypothesisTest:
    """A pose and those that compete with it.

    Attributes
    ----------
    T_target_source : (4, 4) float64
        The pose that no other one beats.
    outcomes : (n,) int8
        Of each keypoint of both scans under it, see `score_keypoints`.
    competing : (K, 4, 4) float64
        Other poses that are not ruled out, best first.
    competing_outcomes : (K, n) int8
    degenerate : tuple of DegenerateDirection
        Directions in which the clouds slide.
    weak : bool
        Whether the surfaces hold any direction so little that it had to be tried.
    """

    T_target_source: Array
    outcomes: NDArray[np.int8]
    competing: Array
    competing_outcomes: NDArray[np.int8]
    degenerate: tuple[DegenerateDirection, ...] = ()
    weak: bool = False


def compete(source: ScanIndex, target: ScanIndex, T_target_source: Array, hypotheses: Array,
            config: SgorConfig) -> HypothesisTest:
    """Test a pose against others, or score it alone where `hypothesis_radius` is 0.

    One that scores too low gets more rounds of ICP: none is refused for a fit on its way.
    """
    if config.hypothesis_radius == 0:
        return alone(source, target, T_target_source)
    if not config.ground_check:
        # what is up may be a wall here, and there the ceiling
        source, target = replace(source, level=False), replace(target, level=False)
    found = hypothesis_test(source, target, T_target_source, hypotheses, config.hypothesis_radius)
    if pose_score(found.outcomes).confidence >= config.min_confidence:
        return found
    T = icp(source, target, found.T_target_source[None], LATE, LATE)
    return replace(found, T_target_source=T[0],
                   outcomes=score_keypoints(source, target, T, MANY)[0])


def alone(source: ScanIndex, target: ScanIndex, T_target_source: Array) -> HypothesisTest:
    """Score a pose without looking for others."""
    nobody = np.empty((0, 4, 4))
    return HypothesisTest(
        T_target_source, score_keypoints(source, target, T_target_source[None], MANY)[0], nobody,
        score_keypoints(source, target, nobody, MANY))


def hypothesis_test(source: ScanIndex, target: ScanIndex, T_target_source: Array,
                    hypotheses: Array, radius: float, *, again: bool = True) -> HypothesisTest:
    """Fit a pose, look for competing ones up to `radius` metres away, and let the best one win.

    Parameters
    ----------
    source, target : ScanIndex
    T_target_source : (4, 4) float64
    hypotheses : (H, 4, 4) float64
        Other candidates, best first.
    radius : float
        Metres.
    again : bool
        Whether another pose that wins is to be tested too.
    """
    T = icp(source, target, T_target_source[None], WIDE, NARROW)[0]
    weak, lever = weak_directions(source, target, T)
    others = _candidates(source, target, T, hypotheses, weak, radius)
    few = score_keypoints(source, target, np.concatenate((T[None], others)), FEW)
    left = others[~ruled_out(few[0], few[1:])]
    pushes = pushes_along(weak, target)
    pushed = 1 + np.arange(len(pushes))
    fitted = np.concatenate((T[None],
                             icp(source, target, perturbed_poses(T, pushes), WIDE, NARROW),
                             icp(source, target, left, 0, NARROW)))
    many = score_keypoints(source, target, fitted, MANY)
    best = best_supported(many)
    if best > 0 and again:
        return hypothesis_test(source, target, fitted[best], hypotheses, radius, again=False)
    standing = differ(fitted[best], fitted, target) & ~ruled_out(many[best], many)
    late = standing.copy()
    late[:1 + len(pushes)] = False
    if late.any():
        # some are only on their way to the answer
        fitted[late] = icp(source, target, fitted[late], LATE, LATE)
        many[late] = score_keypoints(source, target, fitted[late], MANY)
        standing = differ(fitted[best], fitted, target) & ~ruled_out(many[best], many)
    degenerate = tuple(
        measured(source, target, fitted[best], many[best], twist, lever, radius, (WIDE, NARROW),
                 MANY)
        for twist, push, both in zip(weak, pushes, pushed.reshape(2, -1).T, strict=False)
        if is_degenerate(fitted[[0, *both]], standing[both], push))
    standing[pushed] = False    # these were asked for the degenerate directions
    kept = _distinct(fitted, many, best, standing, degenerate, target)
    return HypothesisTest(fitted[best], many[best], fitted[kept], many[kept], degenerate,
                          len(weak) > 0)


def _candidates(source: ScanIndex, target: ScanIndex, T: Array, hypotheses: Array, weak: Array,
                radius: float) -> Array:
    """Return other poses to test, (K, 4, 4), roughly fitted."""
    others = icp(source, target, np.concatenate((
        apart(hypotheses, T, target, FROM_SOLVER),
        correlate_maps(source, target, T, radius))), WIDE, 0, FEW // 2)
    if len(weak):
        others = search_weak_directions(source, target, T, others, weak, radius)
    if source.level and target.level:
        others = others[(others[:, :3, :3] @ source.axes[2]) @ target.axes[2] > LEVEL]
    return others


def _distinct(poses: Array, outcomes: NDArray[np.int8], best: int, standing: NDArray[np.bool_],
              degenerate: tuple[DegenerateDirection, ...], target: ScanIndex) -> list[int]:
    """Return rows of the poses that stand and are really others, the best first."""
    rows = np.flatnonzero(standing)
    against, back = exclusive_violations(outcomes[best], outcomes[rows])
    support = (outcomes[rows] == AGREES).mean(axis=1)
    kept: list[int] = []
    for row in rows[np.argsort(against - back - support, kind='stable')]:
        slid = [slid_back(poses[row], poses[other], degenerate) for other in (best, *kept)]
        if differ(poses[row], np.array(slid), target).all():
            kept.append(int(row))
    return kept
