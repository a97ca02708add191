"""Prediction check: is an expected transformation right? By the clouds, and without SGOR."""
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .common.settings import InputError
from .config import SgorConfig
from .execution.stopwatch import Stopwatch
from .execution.tasks import run_both
from .execution.threads import cores
from .hypotheses.competing import compete
from .hypotheses.competing import HypothesisTest
from .hypotheses.competing import MANY
from .icp.gicp import Alignment
from .icp.point_to_plane import partners
from .prepared_scan import PreparedScan
from .registration import aligned
from .scoring.comparison import differ
from .scoring.pose_scoring import pose_score
from .verdict.decision import decide
from .verdict.decision import low_confidence
from .verdict.decision import Pair
from .verdict.decision import refuse
from .verdict.result import Registration


def check_prediction(source: PreparedScan, target: PreparedScan,
                     T_target_source: NDArray[np.float64], config: SgorConfig) -> Registration:
    """Test a transformation that is expected, to within half a metre and some degrees.

    Nothing is matched. It is fitted, and has to pass all that an answer of `register` has to:
    score, competing hypotheses and degeneracy. Besides, no direction may be weak. There a fit
    stays where it began, and an expectation would confirm itself.

    Parameters
    ----------
    source, target : PreparedScan
    T_target_source : (4, 4) float64
        What is expected.
    config : SgorConfig

    Returns
    -------
    Registration
        Its correspondences are keypoints that lie on each other. Without success it tells
        only that this transformation is not confirmed: ask `register`.

    Raises
    ------
    InputError
        The scans are prepared at two scales; or `hypothesis_radius` is 0, for without competing
        hypotheses nothing is confirmed.
    """
    if source.scale != target.scale:
        raise InputError(f'source: prepared at scale {source.scale:g}, target at {target.scale:g}')
    if config.hypothesis_radius == 0:
        raise InputError('hypothesis_radius = 0: a prediction has to compete with others')
    clock = Stopwatch()
    config = config.scaled(source.scale)
    with cores(config.threads):
        test, alignment = run_both(
            config.threads, partial(_compete, source, target, T_target_source, config, clock),
            partial(aligned, source, target, T_target_source, config, clock))
        rows, at = partners(source.index, target.index, test.T_target_source, MANY)
        pair = Pair(source, target, source.index.points[rows], target.index.points[at], None,
                    clock.seconds)
        reason = _unconfirmed(pair, test, alignment, config)
        if reason:
            return refuse(pair, test, reason, config)
        with clock('verdict'):
            return decide(pair, test, alignment, config)


def _compete(source: PreparedScan, target: PreparedScan, T_target_source: NDArray[np.float64],
             config: SgorConfig, clock: Stopwatch) -> HypothesisTest:
    with clock('competing hypotheses'):
        return compete(source.index, target.index, T_target_source, np.empty((0, 4, 4)), config)


def _unconfirmed(pair: Pair, test: HypothesisTest, alignment: Alignment | None,
                 config: SgorConfig) -> str:
    """Return why a pose is not confirmed, before the verdict; empty where it may be."""
    score = pose_score(test.outcomes)
    if score.confidence < config.min_confidence:
        return low_confidence(score, config)
    if test.weak:
        return 'a direction is held weakly'
    if alignment is not None and differ(test.T_target_source, alignment.T_target_source[None],
                                        pair.target.index).any():
        return 'keypoints and surfaces disagree'
    if len(pair.source_points) < config.min_inliers:
        return f'only {len(pair.source_points)} keypoints on surfaces'
    return ''
