"""The verdict on a registration, from the results of the stages; it is built nowhere else.

REGISTERED means that the clouds bear the transformation out, that no other pose explains them as
well, and that they hold it in all six directions; asked in this order.
"""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..config import SgorConfig
from ..degeneracy.directions import in_words
from ..degeneracy.directions import independent
from ..degeneracy.directions import inflated
from ..hypotheses.competing import HypothesisTest
from ..hypotheses.competing import MANY
from ..icp.gicp import Alignment
from ..prepared_scan import PreparedScan
from ..scoring.comparison import differ
from ..scoring.comparison import ruled_out
from ..scoring.pose_scoring import pose_score
from ..scoring.pose_scoring import PoseScore
from ..scoring.pose_scoring import score_keypoints
from ..solver.refinement import distances
from ..solver.solution import Solution
from ..solver.verification import near_counts
from .result import Placement
from .result import Registration
from .result import Status

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pair:
    """Two scans and what is held to be the same place in both.

    Attributes
    ----------
    source, target : PreparedScan
    source_points, target_points : (K, 3) float64
        Row i of one with row i of the other, metres.
    solution : Solution or None
    timings : dict of str to float
        Stage to seconds.
    """

    source: PreparedScan
    target: PreparedScan
    source_points: Array
    target_points: Array
    solution: Solution | None
    timings: dict[str, float]


def decide(pair: Pair, test: HypothesisTest, alignment: Alignment | None, config: SgorConfig
           ) -> Registration:
    """Return the verdict on a pose that passed the hypothesis test and was aligned by GICP.

    The transformation is that of the alignment where there is one. It is scored once more, and
    compared with the poses that compete.
    """
    T = test.T_target_source if alignment is None else alignment.T_target_source
    source, target = pair.source.index, pair.target.index
    outcomes = score_keypoints(source, target, T[None], MANY)[0]
    score = pose_score(outcomes)
    covariance = None if alignment is None else alignment.covariance
    if score.confidence < config.min_confidence:
        return _registration(pair, config, Status.REFUSED, low_confidence(score, config), T, score,
                             alignment, covariance)
    if covariance is not None:
        covariance = inflated(covariance, test.degenerate)
    free = independent(test.degenerate)
    standing = differ(T, test.competing, target) & ~ruled_out(outcomes, test.competing_outcomes)
    if standing.any():
        others = tuple(
            Placement(other, covariance, free, pose_score(theirs)) for other, theirs in zip(
                test.competing[standing], test.competing_outcomes[standing], strict=True))
        return _registration(
            pair, config, Status.AMBIGUOUS, _ambiguity(T, others), T, score, alignment, covariance,
            alternatives=others, share=1 / (1 + len(others)))
    if test.degenerate:
        known = np.prod([min(1.0, target.max_distance / direction.sigma)
                         for direction in test.degenerate])
        return _registration(
            pair, config, Status.DEGENERATE, in_words(test.degenerate), T, score, alignment,
            covariance, degenerate=free, share=float(known))
    return _registration(pair, config, Status.REGISTERED, '', T, score, alignment, covariance)


def refuse(pair: Pair, test: HypothesisTest, reason: str, config: SgorConfig) -> Registration:
    """Return the verdict on a pose that was not worth an alignment."""
    return _registration(pair, config, Status.REFUSED, reason, test.T_target_source,
                         pose_score(test.outcomes), None, None)


def no_solution(pair: Pair, config: SgorConfig) -> Registration:
    """Return the verdict on matches that gave no pose."""
    assert pair.solution is not None
    return _registration(pair, config, Status.NO_SOLUTION, pair.solution.reason, None, None, None,
                         None)


def decide_by_matches(solution: Solution, config: SgorConfig, timings: dict[str, float]
                      ) -> Registration:
    """Return the verdict on matches alone, for which there are no clouds.

    The confidence weighs the inliers against the most matches outside them that any one other
    hypothesis of the groups explains: wrong transformations have others as strong as themselves,
    0.5. Structured wrong matches can still reach 0.6, so nothing is refused by it.
    """
    given, T, confidence = solution.correspondences, solution.T_target_source, 0.0
    if T is not None:
        outside = ~solution.inliers
        explained = near_counts(solution.hypotheses, given.source[outside], given.target[outside],
                                config.tau_1)
        count, other = int(solution.inliers.sum()), int(explained.max(initial=0))
        confidence = count / max(count + other, 1)
    return Registration(
        Status.NO_SOLUTION if T is None else Status.REGISTERED, solution.reason, T, given.source,
        given.target, solution.inliers, confidence, solution=solution, timings=timings)


def low_confidence(score: PoseScore, config: SgorConfig) -> str:
    """Return the reason for refusing a score below min_confidence."""
    return (f'confidence {score.confidence:.2f} is below min_confidence '
            f'{config.min_confidence:.2f}: of the keypoints {score.overlap:.0%} agree, '
            f'{score.violations:.1%} contradict')


def _registration(pair: Pair, config: SgorConfig, status: Status, reason: str, T: Array | None,
                  score: PoseScore | None, alignment: Alignment | None, covariance: Array | None,
                  *, share: float = 1.0, degenerate: Array | None = None,
                  alternatives: tuple[Placement, ...] = ()) -> Registration:
    if T is not None:
        inliers = distances(T, pair.source_points, pair.target_points) < config.tau_1
    else:
        assert pair.solution is not None
        inliers = pair.solution.inliers
    return Registration(
        status, reason, T, pair.source_points, pair.target_points, inliers,
        confidence=0.0 if score is None else score.confidence * share,
        covariance=covariance,
        correlated_error=None if alignment is None else alignment.correlated_error,
        degenerate=np.empty((0, 6)) if degenerate is None else degenerate,
        alternatives=alternatives, score=score, solution=pair.solution,
        source_ground=pair.source.ground, target_ground=pair.target.ground,
        warnings=_warnings(pair), timings=pair.timings)


def _warnings(pair: Pair) -> tuple[str, ...]:
    """Return what was odd about the two scans."""
    warnings = (*(f'source: {w}' for w in pair.source.warnings),
                *(f'target: {w}' for w in pair.target.warnings))
    labelled = [scan.features.labelled_share > 0 for scan in (pair.source, pair.target)]
    if any(labelled) and not all(labelled):
        warnings += (f'labels ignored: the {"target" if labelled[0] else "source"} has none',)
    return warnings


def _ambiguity(T: Array, alternatives: tuple[Placement, ...]) -> str:
    """Tell how many placements there are, and where the best of the others lies."""
    other = alternatives[0].T_target_source
    gap = other[:3, 3] - T[:3, 3]
    length = float(np.linalg.norm(gap))
    x, y, z = gap / max(length, 1e-9)
    turned = np.degrees(se3.angle(other[:3, :3] @ T[:3, :3].T))
    return (f'ambiguous: {1 + len(alternatives)} placements explain the scans equally well, the '
            f'next {length:.1f} m apart along ({x:.2f}, {y:.2f}, {z:.2f})'
            + (f', turned by {turned:.0f} deg' if turned > 5 else ''))
