"""Whether a transformation that somebody expects is right: judged by the clouds, without SGOR."""
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .common.stopwatch import Stopwatch
from .common.threads import cores
from .config import SgorConfig
from .registration import locally
from .registration import with_grounds
from .result import Registration
from .scan.scan import PreparedScan
from .solver.refinement import unobservable
from .trust.acceptance import compete
from .trust.icp import partners
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
        with clock('rivals'):
            found, contest = compete(expected, source.view, target.view, config)
            if not found.success or contest is None:
                return found
            if contest.weak:
                return replace(found, success=False, reason='a direction is held weakly')
            rows, at = partners(source.view, target.view, contest.T_target_source, MANY)
        found = replace(found, source_points=source.view.points[rows],
                        target_points=target.view.points[at],
                        inliers=np.ones(len(rows), np.bool_))
        reason = unobservable(found.source_points, found.target_points, config)
        if reason:
            return replace(found, success=False, reason=reason)
        return with_grounds(locally(found, contest, source, target, config, clock), source, target)
