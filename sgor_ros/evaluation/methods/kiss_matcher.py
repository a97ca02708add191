"""KISS-Matcher (Lim et al., ICRA 2025), on raw scans or its solver on given matches."""
import time
from typing import Any

import numpy as np

from ...core.common import se3
from .interface import Answer
from .interface import Matches
from .interface import ScanPair


def kiss_matcher(pair: ScanPair, voxel_m: float) -> Answer:
    """KISS-Matcher as in its own example: everything follows from the voxel size."""
    from kiss_matcher import KISSMatcher
    from kiss_matcher import KISSMatcherConfig
    start = time.perf_counter()
    matcher = KISSMatcher(KISSMatcherConfig(voxel_m))
    solution = matcher.estimate(pair.source.points, pair.target.points)
    seconds = time.perf_counter() - start
    return Answer(_transformation(solution), seconds=seconds, valid=bool(solution.valid),
                  score=float(matcher.get_num_final_inliers()))


def kiss_matcher_on_matches(matches: Matches) -> Answer:
    """ROBIN's pruning and GNC, with its noise bounds at half the threshold."""
    from kiss_matcher import KISSMatcher
    from kiss_matcher import KISSMatcherConfig
    # the bounds are the voxel's edge and 0.75 of it: 0.3 m outdoors, as its authors have it
    matcher = KISSMatcher(KISSMatcherConfig(0.5 * matches.inlier_m))
    solution = matcher.prune_and_solve(list(matches.source.astype(np.float32)[:, :, None]),
                                       list(matches.target.astype(np.float32)[:, :, None]))
    return Answer(_transformation(solution) if solution.valid else None,
                  valid=bool(solution.valid))


def _transformation(solution: Any) -> np.ndarray:
    return se3.compose(np.asarray(solution.rotation, np.float64),
                       np.asarray(solution.translation, np.float64).reshape(3))
