"""Whether a transformation that somebody expects is right: judged by the clouds, without SGOR."""
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .alignment import Alignment
from .common.stopwatch import Stopwatch
from .common.tasks import at_once
from .common.threads import cores
from .config import SgorConfig
from .registration import aligned
from .registration import settled
from .registration import with_grounds
from .result import Registration
from .scan.scan import PreparedScan
from .trust.acceptance import compete
from .trust.comparison import differ
from .trust.icp import partners
from .trust.rivals import Contest
from .trust.rivals import MANY

LEAST_CONFIDENCE = SgorConfig().min_confidence
"""A lower `min_confidence` does not hold here: whoever accepts any answer of `register` would
never hear of another one."""


def confirm(source: PreparedScan, target: PreparedScan, T_target_source: NDArray[np.float64],
            config: SgorConfig) -> Registration:
    """Test a transformation that is expected, to within half a metre and some degrees.

    Nothing is matched. It is fitted, and has to pass all that an answer of `register` has to:
    evidence, rivals and degeneracy. Besides, no direction may be held weakly. There a fit stays
    where it began, and an expectation would confirm itself.

    Parameters
    ----------
    source, target : PreparedScan
    T_target_source : (4, 4) float64
        What is expected.
    config : SgorConfig

    Returns
    -------
    Registration
        Its correspondences are keypoints that lie on each other. Without success it says nothing
        but that this transformation is not confirmed: ask `register`.
    """
    clock = Stopwatch()
    nothing = np.empty((0, 3))
    expected = Registration(True, '', T_target_source, nothing, nothing, np.empty(0, np.bool_),
                            timings=clock.seconds)
    if config.rival_radius == 0 or source.scale != target.scale:
        return replace(expected, success=False, reason='no rivals are looked for'
                       if config.rival_radius == 0 else 'the scans differ in scale')
    config = config.scaled(source.scale)
    if config.min_confidence < LEAST_CONFIDENCE:
        config = config.replace(min_confidence=LEAST_CONFIDENCE)
    with cores(config.threads):
        (found, contest), local = at_once(
            config.threads, partial(_contested, expected, source, target, config, clock),
            partial(aligned, source, target, T_target_source, config, clock))
        if not found.success or contest is None:
            return found
        reason = _doubt(found, local, contest, target, config)
        if reason:
            return replace(found, success=False, reason=reason)
        return with_grounds(settled(found, local, contest, source, target, config, clock),
                            source, target)


def _contested(expected: Registration, source: PreparedScan, target: PreparedScan,
               config: SgorConfig, clock: Stopwatch) -> tuple[Registration, Contest | None]:
    """Let it compete with its rivals; its correspondences are what lies on each other."""
    with clock('rivals'):
        found, contest = compete(expected, source.view, target.view, config)
        if contest is None:
            return found, None
        rows, at = partners(source.view, target.view, contest.T_target_source, MANY)
        return replace(found, source_points=source.view.points[rows],
                       target_points=target.view.points[at],
                       inliers=np.ones(len(rows), np.bool_)), contest


def _doubt(found: Registration, local: Alignment | None, contest: Contest, target: PreparedScan,
           config: SgorConfig) -> str:
    """Say why it is not confirmed although it fits; empty where nothing speaks against it."""
    if contest.weak:
        return 'a direction is held weakly'
    if local is not None and differ(contest.T_target_source, local.T_target_source[None],
                                    target.view).any():
        return 'keypoints and surfaces disagree'
    if len(found.inliers) < config.min_inliers:
        return f'only {len(found.inliers)} keypoints on surfaces'
    return ''
