"""RANSAC and fast global registration of Open3D, on FPFH of raw scans or on given matches.

With the settings of its examples, ``registration_ransac.py`` and ``registration_fgr.py``.
"""
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .interface import Answer
from .interface import Matches
from .interface import ScanPair

FPFH_ITERATIONS, MATCHES_ITERATIONS = 100_000, 50_000
"""Of RANSAC."""


def ransac(pair: ScanPair, voxel_m: float) -> Answer:
    """RANSAC on FPFH."""
    registration = _seeded()
    start = time.perf_counter()
    found = registration.registration_ransac_based_on_feature_matching(
        *_described(pair, voxel_m), False,
        *_ransac_options(1.5 * voxel_m, FPFH_ITERATIONS))
    return _answer(found, time.perf_counter() - start)


def ransac_on_matches(matches: Matches) -> Answer:
    """RANSAC on the matches."""
    registration = _seeded()
    return _answer(registration.registration_ransac_based_on_correspondence(
        *_clouds_and_rows(matches), *_ransac_options(matches.inlier_m, MATCHES_ITERATIONS)))


def fast_global(pair: ScanPair, voxel_m: float) -> Answer:
    """Fast global registration on FPFH (Zhou et al., ECCV 2016)."""
    registration = _seeded()
    start = time.perf_counter()
    found = registration.registration_fgr_based_on_feature_matching(
        *_described(pair, voxel_m), _fgr_option(1.5 * voxel_m))
    return _answer(found, time.perf_counter() - start)


def fast_global_on_matches(matches: Matches) -> Answer:
    """Fast global registration on the matches."""
    registration = _seeded()
    return _answer(registration.registration_fgr_based_on_correspondence(
        *_clouds_and_rows(matches), _fgr_option(matches.inlier_m)))


def _seeded() -> Any:
    import open3d as o3d
    o3d.utility.random.seed(0)
    return o3d.pipelines.registration


def _ransac_options(distance_m: float, iterations: int) -> tuple[Any, ...]:
    import open3d as o3d
    registration = o3d.pipelines.registration
    return (distance_m, registration.TransformationEstimationPointToPoint(False), 3,
            [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
             registration.CorrespondenceCheckerBasedOnDistance(distance_m)],
            registration.RANSACConvergenceCriteria(iterations, 0.999))


def _fgr_option(distance_m: float) -> Any:
    import open3d as o3d
    return o3d.pipelines.registration.FastGlobalRegistrationOption(
        maximum_correspondence_distance=distance_m, iteration_number=64, maximum_tuple_count=1000)


def _described(pair: ScanPair, voxel_m: float) -> tuple[Any, Any, Any, Any]:
    """Return both thinned clouds and their FPFH, with the radii of Open3D's examples."""
    (p, p_features), (q, q_features) = (
        _fpfh(scan.points, voxel_m) for scan in (pair.source, pair.target))
    return p, q, p_features, q_features


def _fpfh(points: NDArray[np.float32], voxel_m: float) -> tuple[Any, Any]:
    import open3d as o3d
    thin = _cloud(points).voxel_down_sample(voxel_m)
    thin.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel_m, 30))
    # its stubs ask for an argument that is optional
    describe: Any = o3d.pipelines.registration.compute_fpfh_feature
    return thin, describe(thin, o3d.geometry.KDTreeSearchParamHybrid(5 * voxel_m, 100))


def _clouds_and_rows(matches: Matches) -> tuple[Any, Any, Any]:
    """Return both clouds and the pairs of rows, as Open3D takes them."""
    import open3d as o3d
    rows = np.repeat(np.arange(len(matches.source))[:, None], 2, axis=1)
    return _cloud(matches.source), _cloud(matches.target), o3d.utility.Vector2iVector(rows)


def _cloud(points: NDArray[Any]) -> Any:
    import open3d as o3d
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))


def _answer(found: Any, seconds: float = float('nan')) -> Answer:
    # both always answer
    return Answer(np.array(found.transformation, np.float64), seconds=seconds,
                  score=float(found.fitness))
