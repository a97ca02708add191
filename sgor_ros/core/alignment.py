"""Local refinement on the clouds by GICP, and the covariance that follows (beyond the paper)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
import small_gicp

from .config import SgorConfig

NEIGHBOURS = 10
"""Points behind each local covariance of GICP."""
CORRELATED_PAIRS = 40
"""So many pairs of points err as one: without it the errors measured on KITTI and on the built-in
street are 5 to 7 standard deviations; see docs/method.md."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A thinned cloud with local covariances and its search tree, as small_gicp wants them."""

    cloud: small_gicp.PointCloud
    tree: small_gicp.KdTree


@dataclass(frozen=True, eq=False)
class Alignment:
    """What GICP arrived at.

    Attributes
    ----------
    T_target_source : (4, 4) float64
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2; None where a
        direction is not observed at all.
    converged : bool
    pairs : int
        Points that found a partner.
    """

    T_target_source: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    converged: bool
    pairs: int


def surface(points: NDArray[np.float64], threads: int) -> Surface | None:
    """Estimate local covariances of (V, 3) thinned points; None with too few for them."""
    if len(points) < NEIGHBOURS:
        return None
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, num_threads=threads)
    small_gicp.estimate_covariances(cloud, tree, num_neighbors=NEIGHBOURS, num_threads=threads)
    return Surface(cloud, tree)


def align(source: Surface, target: Surface, T_target_source: NDArray[np.float64],
          config: SgorConfig) -> Alignment:
    """Refine a transformation by GICP, from within `local_reach`."""
    result = small_gicp.align(
        target.cloud, source.cloud, target.tree, T_target_source, registration_type='GICP',
        max_correspondence_distance=config.local_reach, num_threads=config.threads,
        max_iterations=30)
    T = np.asarray(result.T_target_source)
    return Alignment(T, _covariance(result, T), bool(result.converged), int(result.num_inliers))


def _covariance(result: small_gicp.RegistrationResult,
                T: NDArray[np.float64]) -> NDArray[np.float64] | None:
    hessian, pairs = np.asarray(result.H), int(result.num_inliers)
    if pairs <= 6 or np.linalg.cond(hessian) > 1e12:
        return None
    # GICP's errors are Mahalanobis: their mean square scales the inverse Hessian
    mean_square = 2.0 * result.error / (3 * pairs - 6)
    local = np.linalg.inv(hessian) * mean_square * CORRELATED_PAIRS
    # from (rotation, translation) on the right of T to (translation, rotation) in the target
    R = T[:3, :3]
    to_target = np.zeros((6, 6))
    to_target[:3, 3:] = R
    to_target[3:, :3] = R
    covariance: NDArray[np.float64] = to_target @ local @ to_target.T
    return covariance
