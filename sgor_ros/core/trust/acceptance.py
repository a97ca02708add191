"""Whether to trust a registration: evidence, rivals, degeneracy, in this order (beyond the paper).

Success means that the clouds bear the transformation out, that no other placement explains them
as well, and that they hold it in all six directions.
"""
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..config import SgorConfig
from ..result import Placement
from ..result import Registration
from ..solver.refinement import distances
from ..solver.verification import near_counts
from .comparison import differ
from .comparison import ruled_out
from .degeneracy import directions
from .degeneracy import in_words
from .degeneracy import inflate
from .evidence import evidence_of
from .evidence import testify
from .icp import icp
from .rivals import Contest
from .rivals import contest
from .rivals import LATE
from .rivals import MANY
from .view import View


def judge_matches(result: Registration, config: SgorConfig) -> Registration:
    """Add a confidence to a candidate from matches alone, for which there are no clouds.

    It weighs the inliers against the most matches outside them that any one other hypothesis of
    the groups explains: wrong transformations have rivals as strong as themselves, 0.5. Structured
    wrong matches can still reach 0.6, so nothing is refused by it.
    """
    if result.T_target_source is None:
        return result
    outside = ~result.inliers
    explained = near_counts(result.hypotheses, result.source_points[outside],
                            result.target_points[outside], config.tau_1)
    count, rival = int(result.inliers.sum()), int(explained.max(initial=0))
    return replace(result, confidence=count / max(count + rival, 1),
                   evidence={'inliers': count, 'rival': rival})


def compete(result: Registration, source: View, target: View, config: SgorConfig
            ) -> tuple[Registration, Contest | None]:
    """Let a candidate compete with its rivals; refuse the winner below `min_confidence`."""
    if result.T_target_source is None:
        return result, None
    if config.rival_radius > 0:
        if not config.ground_check:
            # what is up may be a wall here, and there the ceiling
            source, target = replace(source, level=False), replace(target, level=False)
        order = np.argsort(-result.hypothesis_scores, kind='stable')
        ranked = result.hypotheses[order[np.isfinite(result.hypothesis_scores[order])]]
        found = contest(source, target, result.T_target_source, ranked, config.rival_radius)
    else:
        T = result.T_target_source[None]
        nobody = np.empty((0, 4, 4))
        found = Contest(T[0], testify(source, target, T, MANY)[0], nobody,
                        testify(source, target, nobody, MANY))
    believed = believe(_at(result, found.T_target_source, config), found.outcomes, config)
    if believed.success or config.rival_radius == 0:
        return believed, found
    # not refused for a fit that was only on its way
    T = icp(source, target, found.T_target_source[None], LATE, LATE)
    found = replace(found, T_target_source=T[0], outcomes=testify(source, target, T, MANY)[0])
    return believe(_at(result, T[0], config), found.outcomes, config), found


def believe(result: Registration, outcomes: NDArray[np.int8], config: SgorConfig) -> Registration:
    """Add confidence and evidence to a candidate; refuse it below `min_confidence`."""
    found = evidence_of(outcomes)
    result = replace(result, confidence=found.confidence,
                     evidence={'agree': found.agree, 'contradict': found.contradict})
    if not result.success or found.confidence >= config.min_confidence:
        return result
    return replace(result, success=False,
                   reason=f'confidence {found.confidence:.2f} is below min_confidence '
                          f'{config.min_confidence:.2f}: of the keypoints {found.agree:.0%} '
                          f'agree, {found.contradict:.1%} contradict')


def settle(result: Registration, found: Contest, source: View, target: View,
           config: SgorConfig) -> Registration:
    """Judge the transformation once more after its refinement on the clouds, beside its rivals."""
    T = result.T_target_source
    assert T is not None
    outcomes = testify(source, target, T[None], MANY)[0]
    result = believe(result, outcomes, config)
    if not result.success:
        return result
    covariance = result.covariance
    if covariance is not None:
        covariance = inflate(covariance, found.slides)
    standing = (differ(T, found.rivals, target)
                & ~ruled_out(outcomes, found.rival_outcomes))
    if standing.any():
        free = directions(found.slides)
        alternatives = tuple(
            Placement(rival, covariance, free, vars(evidence_of(said)))
            for rival, said in zip(found.rivals[standing], found.rival_outcomes[standing],
                                   strict=True))
        return replace(result, success=False, alternatives=alternatives, covariance=covariance,
                       confidence=result.confidence / (1 + len(alternatives)),
                       reason=_ambiguity(T, alternatives))
    if found.slides:
        known = np.prod([min(1.0, target.reach / slide.sigma) for slide in found.slides])
        return replace(result, success=False, degenerate=directions(found.slides),
                       covariance=covariance, confidence=result.confidence * float(known),
                       reason=in_words(found.slides))
    return result


def _at(result: Registration, T: NDArray[np.float64], config: SgorConfig) -> Registration:
    """Move a result to a transformation and count its inliers anew."""
    agree = distances(T, result.source_points, result.target_points) < config.tau_1
    return replace(result, T_target_source=T, inliers=agree)


def _ambiguity(T: NDArray[np.float64], alternatives: tuple[Placement, ...]) -> str:
    """Say how many placements there are, and where the best of the others lies."""
    other = alternatives[0].T_target_source
    gap = other[:3, 3] - T[:3, 3]
    length = float(np.linalg.norm(gap))
    x, y, z = gap / max(length, 1e-9)
    cosine = np.clip((np.trace(other[:3, :3] @ T[:3, :3].T) - 1) / 2, -1, 1)
    turned = np.degrees(np.arccos(cosine))
    return (f'ambiguous: {1 + len(alternatives)} placements explain the scans equally well, the '
            f'next {length:.1f} m apart along ({x:.2f}, {y:.2f}, {z:.2f})'
            + (f', turned by {turned:.0f} deg' if turned > 5 else ''))
