"""Solvers of other packages on given matches; each imported only when run."""
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from .problem import Matches
from .problem import Solution

ITERATIONS = 50_000
"""Of RANSAC."""


def ransac(matches: Matches) -> Solution:
    """RANSAC of Open3D on the matches."""
    import open3d as o3d
    registration = o3d.pipelines.registration
    o3d.utility.random.seed(0)
    found = registration.registration_ransac_based_on_correspondence(
        *_of_open3d(matches), matches.inlier_m,
        registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
         registration.CorrespondenceCheckerBasedOnDistance(matches.inlier_m)],
        registration.RANSACConvergenceCriteria(ITERATIONS, 0.999))
    return Solution(np.array(found.transformation))


def fast_global(matches: Matches) -> Solution:
    """Fast global registration of Open3D on the matches (Zhou et al., ECCV 2016)."""
    import open3d as o3d
    registration = o3d.pipelines.registration
    o3d.utility.random.seed(0)
    found = registration.registration_fgr_based_on_correspondence(
        *_of_open3d(matches), registration.FastGlobalRegistrationOption(
            maximum_correspondence_distance=matches.inlier_m, iteration_number=64,
            maximum_tuple_count=1000))
    return Solution(np.array(found.transformation))


def kiss_matcher_solver(matches: Matches) -> Solution:
    """ROBIN's pruning and GNC of KISS-Matcher, with its noise bounds at half the threshold."""
    from kiss_matcher import KISSMatcher
    from kiss_matcher import KISSMatcherConfig
    # the bounds are the voxel's edge and 0.75 of it: 0.3 m outdoors, as its authors have it
    matcher = KISSMatcher(KISSMatcherConfig(0.5 * matches.inlier_m))
    solution = matcher.prune_and_solve(list(matches.source.astype(np.float32)[:, :, None]),
                                       list(matches.target.astype(np.float32)[:, :, None]))
    if not solution.valid:
        return Solution(None)
    R: NDArray[np.float64] = np.asarray(solution.rotation, np.float64)
    return Solution(se3.compose(R, np.asarray(solution.translation, np.float64).reshape(3)))


def _of_open3d(matches: Matches) -> tuple[Any, Any, Any]:
    """Return both clouds and the pairs of rows, as Open3D takes them."""
    import open3d as o3d
    source, target = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
                      for points in (matches.source, matches.target))
    rows = np.repeat(np.arange(len(matches.source))[:, None], 2, axis=1)
    return source, target, o3d.utility.Vector2iVector(rows)
