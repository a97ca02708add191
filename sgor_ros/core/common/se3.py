"""Rigid transformations as (4, 4) float64 matrices; ``T_target_source`` maps source to target."""
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def transform(T_target_source: Array, points: Array) -> Array:
    """Move (N, 3) points of the source into the target."""
    return points @ T_target_source[:3, :3].T + T_target_source[:3, 3]


def inverse(T_target_source: Array) -> Array:
    """Return T_source_target."""
    R, t = T_target_source[:3, :3], T_target_source[:3, 3]
    return compose(R.T, -R.T @ t)


def compose(R: Array, t: Array) -> Array:
    """Put a (3, 3) rotation and a (3,) translation into a (4, 4) matrix."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t
    return T


def angle(R: Array) -> float:
    """Return the angle of a (3, 3) rotation, radians in [0, pi]."""
    return float(Rotation.from_matrix(R).magnitude())
