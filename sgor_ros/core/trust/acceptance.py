"""Whether to trust a registration: confidence from evidence (beyond the paper)."""
from dataclasses import replace

from ..config import SgorConfig
from ..result import Registration
from ..solver.verification import near_counts
from .evidence import evidence
from .evidence import View


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


def judge(result: Registration, source: View, target: View, reach: float,
          config: SgorConfig) -> Registration:
    """Add confidence and evidence to a candidate; refuse it below `min_confidence`.

    `reach` is the farthest partner that counts, metres.
    """
    if result.T_target_source is None:
        return result
    found = evidence(source, target, result.T_target_source, reach)
    result = replace(result, confidence=found.confidence,
                     evidence={'agree': found.agree, 'contradict': found.contradict})
    if not result.success or found.confidence >= config.min_confidence:
        return result
    return replace(result, success=False,
                   reason=f'confidence {found.confidence:.2f} is below min_confidence '
                          f'{config.min_confidence:.2f}: of the keypoints {found.agree:.0%} '
                          f'agree, {found.contradict:.0%} contradict')
