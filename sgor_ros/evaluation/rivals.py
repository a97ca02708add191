"""Other methods with the settings that their authors recommend; each imported only when run."""
from collections.abc import Callable
import time
from typing import Any
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.verdict.result import Registration

Array = NDArray[np.float64]
Points = NDArray[np.float32]


class Answer(NamedTuple):
    """What a method said about two scans.

    Attributes
    ----------
    T_target_source : (4, 4) float64 or None
    seconds : float
        From two raw scans to the transformation.
    valid : bool
        Whether the method itself trusts it.
    score : float
        By what it judged: confidence, inliers or fitness.
    seconds_one_new : float
        With one of the scans prepared before; NaN where a method cannot do that.
    result : Registration or None
        All that SGOR said; None for rivals.
    """

    T_target_source: Array | None
    seconds: float
    valid: bool
    score: float
    seconds_one_new: float = float('nan')
    result: Registration | None = None


def kiss_matcher(source: Points, target: Points, voxel_m: float) -> Answer:
    """KISS-Matcher as in its own example: everything follows from the voxel size."""
    from kiss_matcher import KISSMatcher
    from kiss_matcher import KISSMatcherConfig
    start = time.perf_counter()
    matcher = KISSMatcher(KISSMatcherConfig(voxel_m))
    solution = matcher.estimate(source, target)
    seconds = time.perf_counter() - start
    T = se3.compose(np.asarray(solution.rotation, np.float64),
                    np.asarray(solution.translation, np.float64).reshape(3))
    return Answer(T, seconds, bool(solution.valid), float(matcher.get_num_final_inliers()))


def ransac(source: Points, target: Points, voxel_m: float) -> Answer:
    """RANSAC on FPFH as in the example of Open3D, ``registration_ransac.py``."""
    import open3d as o3d
    registration = o3d.pipelines.registration
    o3d.utility.random.seed(0)
    start = time.perf_counter()
    distance = 1.5 * voxel_m
    (p, p_features), (q, q_features) = (_described(points, voxel_m) for points in (source, target))
    found = registration.registration_ransac_based_on_feature_matching(
        p, q, p_features, q_features, False, distance,
        registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
         registration.CorrespondenceCheckerBasedOnDistance(distance)],
        registration.RANSACConvergenceCriteria(100_000, 0.999))
    return _open3d_answer(found, start)


def fast_global(source: Points, target: Points, voxel_m: float) -> Answer:
    """Fast global registration as in the example of Open3D, ``registration_fgr.py``."""
    import open3d as o3d
    registration = o3d.pipelines.registration
    o3d.utility.random.seed(0)
    start = time.perf_counter()
    (p, p_features), (q, q_features) = (_described(points, voxel_m) for points in (source, target))
    found = registration.registration_fgr_based_on_feature_matching(
        p, q, p_features, q_features, registration.FastGlobalRegistrationOption(
            maximum_correspondence_distance=1.5 * voxel_m, iteration_number=64,
            maximum_tuple_count=1000))
    return _open3d_answer(found, start)


def _described(points: Points, voxel_m: float) -> tuple[Any, Any]:
    """Return the thinned cloud and its FPFH, with the radii of Open3D's examples."""
    import open3d as o3d
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    thin = cloud.voxel_down_sample(voxel_m)
    thin.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel_m, 30))
    # its stubs ask for an argument that is optional
    describe: Any = o3d.pipelines.registration.compute_fpfh_feature
    return thin, describe(thin, o3d.geometry.KDTreeSearchParamHybrid(5 * voxel_m, 100))


def _open3d_answer(found: Any, start: float) -> Answer:
    # both always answer
    return Answer(np.array(found.transformation, np.float64), time.perf_counter() - start, True,
                  float(found.fitness))


def kiss_icp() -> Callable[[Points], Array]:
    """Return KISS-ICP in its default settings: takes a scan, returns T_odom_sensor."""
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP
    odometry = KissICP(load_config(None))
    no_stamps = np.empty(0)    # these scans have none a point, so there is nothing to deskew

    def step(points: Points) -> Array:
        odometry.register_frame(points.astype(np.float64), no_stamps)
        return np.array(odometry.last_pose)

    return step


def scan_to_scan(threads: int) -> Callable[[Points], Array]:
    """Return GICP of small_gicp between consecutive scans: takes a scan, returns T_odom_sensor.

    Its default settings; the motion of the last step is the guess for the next.
    """
    import small_gicp
    pose, step_before = np.eye(4), np.eye(4)
    last: Any = None

    def step(points: Points) -> Array:
        nonlocal pose, step_before, last
        cloud, tree = small_gicp.preprocess_points(points.astype(np.float64), num_threads=threads)
        if last is not None:
            found = small_gicp.align(last[0], cloud, last[1], init_T_target_source=step_before,
                                     num_threads=threads)
            step_before = np.array(found.T_target_source)
            pose = pose @ step_before
        last = cloud, tree
        return pose

    return step
