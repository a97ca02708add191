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


def skew(v: Array) -> Array:
    """Return the (3, 3) matrix of the cross product with (3,)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def exp(twist: Array) -> Array:
    """Return the (4, 4) motion of a (6,) twist, linear first, that acts for a unit of time."""
    return compose(Rotation.from_rotvec(twist[3:]).as_matrix(), _left(twist[3:]) @ twist[:3])


def log(T: Array) -> Array:
    """Return the (6,) twist whose motion is a (4, 4) transformation; the inverse of `exp`."""
    turn = Rotation.from_matrix(T[:3, :3]).as_rotvec()
    return np.concatenate((np.linalg.solve(_left(turn), T[:3, 3]), turn))


def _left(turn: Array) -> Array:
    """Return the (3, 3) left Jacobian of SO(3) at a (3,) rotation vector."""
    K, a = skew(turn), float(np.linalg.norm(turn))
    if a < 1e-6:
        return np.eye(3) + K / 2
    return np.asarray(np.eye(3) + (1 - np.cos(a)) / a**2 * K + (a - np.sin(a)) / a**3 * (K @ K))


def perturbation(T: Array, T_from: Array) -> Array:
    """Return what leads from one (4, 4) pose to another, (6,): of the origin, then a rotation.

    Both in the frame that the poses are given in, as covariances of poses are.
    """
    turn = Rotation.from_matrix(T[:3, :3] @ T_from[:3, :3].T).as_rotvec()
    return np.concatenate((T[:3, 3] - T_from[:3, 3], turn))


def perturbed(T: Array, by: Array) -> Array:
    """Return a (4, 4) pose moved by a (6,) `perturbation`."""
    return compose(Rotation.from_rotvec(by[3:]).as_matrix() @ T[:3, :3], T[:3, 3] + by[:3])


def carried(lever: Array) -> Array:
    """Return the (6, 6) matrix that takes a perturbation of a pose to the end of a (3,) lever."""
    matrix = np.eye(6)
    matrix[:3, 3:] = -skew(lever)
    return matrix


def turned(R: Array) -> Array:
    """Return the (6, 6) matrix that turns a perturbation by a (3, 3) rotation."""
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = R
    return matrix
