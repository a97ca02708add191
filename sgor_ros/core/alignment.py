"""Local refinement on the clouds by GICP, and the covariance that follows (beyond the paper)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
import small_gicp

from .common.threads import openmp_threads
from .config import SgorConfig
from .covariance import noise
from .covariance import repeating
from .covariance import scattered
from .covariance import systematic

NEIGHBOURS = 10
"""Points behind each local covariance of GICP."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A thinned cloud with local covariances and its search tree, as small_gicp wants them.

    Attributes
    ----------
    cloud : small_gicp.PointCloud
    tree : small_gicp.KdTree
    middle_range : float
        Median distance of its points from the sensor, metres.
    """

    cloud: small_gicp.PointCloud
    tree: small_gicp.KdTree
    middle_range: float


@dataclass(frozen=True, eq=False)
class Alignment:
    """What GICP arrived at.

    Attributes
    ----------
    T_target_source : (4, 4) float64
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2; None where a
        direction is not observed at all.
    systematic : (6, 6) float64
        As of `Registration`.
    converged : bool
    pairs : int
        Points that found a partner.
    """

    T_target_source: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    systematic: NDArray[np.float64]
    converged: bool
    pairs: int


def surface(points: NDArray[np.float64], threads: int) -> Surface | None:
    """Estimate local covariances of (V, 3) thinned points; None with too few for them."""
    if len(points) < NEIGHBOURS:
        return None
    cloud = small_gicp.PointCloud(points)
    threads = openmp_threads(threads)
    tree = small_gicp.KdTree(cloud, num_threads=threads)
    small_gicp.estimate_covariances(cloud, tree, num_neighbors=NEIGHBOURS, num_threads=threads)
    return Surface(cloud, tree, float(np.median(np.linalg.norm(points, axis=1))))


def align(source: Surface, target: Surface, T_target_source: NDArray[np.float64],
          config: SgorConfig) -> Alignment:
    """Refine a transformation by GICP, from within `local_reach`."""
    result = small_gicp.align(
        target.cloud, source.cloud, target.tree, T_target_source, registration_type='GICP',
        max_correspondence_distance=config.local_reach, num_threads=openmp_threads(config.threads),
        max_iterations=30)
    T = np.asarray(result.T_target_source)
    pairs = int(result.num_inliers)
    repeated = systematic(T, source.middle_range, config.voxel_size)
    random = noise(np.asarray(result.H), result.error, pairs, T)
    if random is None:
        return Alignment(T, None, repeated, bool(result.converged), pairs)
    wider = scattered(random, source.middle_range, config.voxel_size)
    covariance = wider + repeated @ repeated.T
    return Alignment(T, covariance, repeating(repeated, random, wider), bool(result.converged),
                     pairs)
