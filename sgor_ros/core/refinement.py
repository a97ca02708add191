"""Transformation refinement on all correspondences (Sec. III-E, Eq. 20)."""
import numpy as np
from numpy.typing import NDArray

from . import se3
from .config import SgorConfig
from .correspondences import Correspondences
from .hypotheses import fit_transforms
from .hypotheses import MIN_POINTS


def refine(T_target_source: NDArray[np.float64], correspondences: Correspondences,
           config: SgorConfig) -> NDArray[np.float64]:
    """Fit by SVD to all correspondences nearer than tau_1, `refinement_rounds` times.

    Returns the input where fewer than three are.
    """
    T = T_target_source
    for _ in range(config.refinement_rounds):
        near = inliers(T, correspondences, config.tau_1)
        if near.sum() < MIN_POINTS:
            break
        p, q = correspondences.source[near], correspondences.target[near]
        T = fit_transforms(p[None], q[None], np.ones((1, len(p))))[0]
    return T


def inliers(T_target_source: NDArray[np.float64], correspondences: Correspondences,
            reach: float) -> NDArray[np.bool_]:
    """Return which correspondences lie within `reach` metres under a transformation, (N,)."""
    moved = se3.transform(T_target_source, correspondences.source)
    return np.linalg.norm(moved - correspondences.target, axis=1) < reach
