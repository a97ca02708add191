"""KISS-Matcher, on raw scans and its solver alone."""
import time
from typing import Any

from kiss_matcher import KISSMatcher
from kiss_matcher import KISSMatcherConfig
import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ..pairs.pair import Matches
from ..pairs.pair import Scans
from .method import Estimate


def on_scans(scans: Scans, voxel_m: float) -> Estimate:
    """KISS-Matcher as in its own example: everything follows from the voxel size."""
    start = time.perf_counter()
    matcher = KISSMatcher(KISSMatcherConfig(voxel_m))
    solution = matcher.estimate(scans.source.points, scans.target.points)
    seconds = time.perf_counter() - start
    return Estimate(_transformation(solution), accepted=bool(solution.valid),
                    score=float(matcher.get_num_final_inliers()), seconds=seconds)


def solver(matches: Matches) -> Estimate:
    """ROBIN's pruning and GNC on the matches, with the noise bounds at half the threshold."""
    # the bounds are the voxel's edge and 0.75 of it: 0.3 m outdoors, as its authors have it
    matcher = KISSMatcher(KISSMatcherConfig(0.5 * matches.inlier_m))
    solution = matcher.prune_and_solve(list(matches.source.astype(np.float32)[:, :, None]),
                                       list(matches.target.astype(np.float32)[:, :, None]))
    return Estimate(_transformation(solution) if solution.valid else None)


def _transformation(solution: Any) -> NDArray[np.float64]:
    return se3.compose(np.asarray(solution.rotation, np.float64),
                       np.asarray(solution.translation, np.float64).reshape(3))
