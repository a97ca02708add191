"""RANSAC and fast global registration of Open3D, on matches and on raw scans.

On raw scans as in Open3D's examples ``registration_ransac.py`` and ``registration_fgr.py``.
"""
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
import open3d as o3d

from ..pairs.pair import Matches
from ..pairs.pair import Scans
from .method import Estimate

registration = o3d.pipelines.registration

ITERATIONS, ITERATIONS_ON_SCANS = 50_000, 100_000
"""Of RANSAC."""


def ransac(matches: Matches) -> Estimate:
    """RANSAC on the matches."""
    o3d.utility.random.seed(0)
    found = registration.registration_ransac_based_on_correspondence(
        *_as_open3d(matches), matches.inlier_m, *_ransac_options(matches.inlier_m, ITERATIONS))
    return Estimate(np.array(found.transformation))


def fast_global(matches: Matches) -> Estimate:
    """Fast global registration on the matches (Zhou et al., ECCV 2016)."""
    o3d.utility.random.seed(0)
    found = registration.registration_fgr_based_on_correspondence(
        *_as_open3d(matches), _fast_global_options(matches.inlier_m))
    return Estimate(np.array(found.transformation))


def ransac_on_scans(scans: Scans, voxel_m: float) -> Estimate:
    """RANSAC on FPFH."""
    o3d.utility.random.seed(0)
    start = time.perf_counter()
    distance = 1.5 * voxel_m
    (p, p_features), (q, q_features) = (_described(scan.points, voxel_m)
                                        for scan in (scans.source, scans.target))
    return _answer(registration.registration_ransac_based_on_feature_matching(
        p, q, p_features, q_features, False, distance,
        *_ransac_options(distance, ITERATIONS_ON_SCANS)), start)


def fast_global_on_scans(scans: Scans, voxel_m: float) -> Estimate:
    """Fast global registration on FPFH."""
    o3d.utility.random.seed(0)
    start = time.perf_counter()
    (p, p_features), (q, q_features) = (_described(scan.points, voxel_m)
                                        for scan in (scans.source, scans.target))
    return _answer(registration.registration_fgr_based_on_feature_matching(
        p, q, p_features, q_features, _fast_global_options(1.5 * voxel_m)), start)


def _ransac_options(distance_m: float, iterations: int) -> tuple[Any, ...]:
    return (registration.TransformationEstimationPointToPoint(False), 3,
            [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
             registration.CorrespondenceCheckerBasedOnDistance(distance_m)],
            registration.RANSACConvergenceCriteria(iterations, 0.999))


def _fast_global_options(distance_m: float) -> Any:
    return registration.FastGlobalRegistrationOption(
        maximum_correspondence_distance=distance_m, iteration_number=64, maximum_tuple_count=1000)


def _as_open3d(matches: Matches) -> tuple[Any, Any, Any]:
    """Return both clouds and the pairs of rows."""
    source, target = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
                      for points in (matches.source, matches.target))
    rows = np.repeat(np.arange(len(matches.source))[:, None], 2, axis=1)
    return source, target, o3d.utility.Vector2iVector(rows)


def _described(points: NDArray[np.float32], voxel_m: float) -> tuple[Any, Any]:
    """Return the thinned cloud and its FPFH, with the radii of Open3D's examples."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    thin = cloud.voxel_down_sample(voxel_m)
    thin.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel_m, 30))
    # its stubs ask for an argument that is optional
    describe: Any = registration.compute_fpfh_feature
    return thin, describe(thin, o3d.geometry.KDTreeSearchParamHybrid(5 * voxel_m, 100))


def _answer(found: Any, start: float) -> Estimate:
    # both always answer
    return Estimate(np.array(found.transformation, np.float64), score=float(found.fitness),
                    seconds=time.perf_counter() - start)
