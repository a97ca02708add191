"""Transformation refinement on all correspondences (Sec. III-E, Eq. 20)."""
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..config import SgorConfig
from ..matching.correspondences import Correspondences
from .hypotheses import fit_transforms
from .hypotheses import MIN_POINTS


def refine(T_target_source: NDArray[np.float64], correspondences: Correspondences,
           config: SgorConfig) -> NDArray[np.float64]:
    """Fit by SVD to all correspondences nearer than tau_1, `refinement_rounds` times.

    Returns the input where fewer than three are.
    """
    T = T_target_source
    for _ in range(config.refinement_rounds):
        near = distances(T, correspondences.source, correspondences.target) < config.tau_1
        if near.sum() < MIN_POINTS:
            break
        p, q = correspondences.source[near], correspondences.target[near]
        T = fit_transforms(p[None], q[None], np.ones((1, len(p))))[0]
    return T


def distances(T_target_source: NDArray[np.float64], source: NDArray[np.float64],
              target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far each match lies apart under a transformation, (N,) metres."""
    residual: NDArray[np.float64] = np.linalg.norm(
        se3.transform(T_target_source, source) - target, axis=1)
    return residual


def unobservable(source: NDArray[np.float64], target: NDArray[np.float64],
                 config: SgorConfig) -> str:
    """Return why (K, 3) inliers do not hold a transformation, in words; empty where they do.

    Nothing is asked where `min_inliers` is 0 (the paper).
    """
    if config.min_inliers == 0:
        return ''
    # several matches may end at the same point
    distinct = min(len(np.unique(points, axis=0)) for points in (source, target))
    if distinct < config.min_inliers:
        shared = f': {len(source)} matches agree, at {distinct} points' * (len(source) > distinct)
        return f'only {distinct} inliers, min_inliers is {config.min_inliers}{shared}'
    for points in (source, target):
        across = np.sqrt(np.linalg.eigvalsh(np.cov(points.T))[1])
        if across < config.sigma_d / 4:
            return f'all inliers lie on a line, {across:.3f} m wide'
    return ''
