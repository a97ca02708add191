"""Rigid transformations as (4, 4) float64 matrices; ``T_target_source`` maps source to target."""
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .products import times_transposed

Array = NDArray[np.float64]

NEARLY_HALF = -0.99
"""Cosine of turns by nearly half."""


def transform(T_target_source: Array, points: Array) -> Array:
    """Move (N, 3) points of the source into the target."""
    return times_transposed(points, T_target_source[:3, :3]) + T_target_source[:3, 3]


def inverse(T_target_source: Array) -> Array:
    """Return T_source_target."""
    R, t = T_target_source[:3, :3], T_target_source[:3, 3]
    return compose(R.T, -R.T @ t)


def compose(R: Array, t: Array) -> Array:
    """Put (..., 3, 3) rotations and (..., 3) translations into (..., 4, 4) matrices."""
    T = np.zeros((*np.shape(t)[:-1], 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def angle(R: Array) -> float:
    """Return the angle of a (3, 3) rotation, radians in [0, pi]."""
    return float(np.linalg.norm(rotation_vectors(R)))


def rotation_vectors(R: Array) -> Array:
    """Return the vectors of (..., 3, 3) rotations, (..., 3): axis times angle, up to pi.

    Scipy's take ten times as long, which adds up to milliseconds a scan.
    """
    sines = np.stack((R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0],
                      R[..., 1, 0] - R[..., 0, 1]), axis=-1) / 2
    sine = np.sqrt((sines * sines).sum(axis=-1))
    cosine = (R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2] - 1) / 2
    vectors: Array = sines * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-300))[..., None]
    half = cosine < NEARLY_HALF
    if half.any():    # there the sines say little of the axis
        vectors[half] = Rotation.from_matrix(R[half]).as_rotvec()
    return vectors


def rotations(vectors: Array) -> Array:
    """Return the (..., 3, 3) rotations of (..., 3) vectors."""
    K = np.zeros((*vectors.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = np.moveaxis(vectors, -1, 0)
    K[..., 1, 2], K[..., 2, 0], K[..., 0, 1] = -np.moveaxis(vectors, -1, 0)
    angles = np.sqrt((vectors * vectors).sum(axis=-1))[..., None, None]
    return np.asarray(np.eye(3) + np.sinc(angles / np.pi) * K
                      + np.sinc(angles / (2 * np.pi))**2 / 2 * (K @ K))


def skew(v: Array) -> Array:
    """Return the (3, 3) matrix of the cross product with (3,)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def exp(twist: Array) -> Array:
    """Return the (4, 4) motion of a (6,) twist, linear first, that acts for a unit of time."""
    return compose(rotations(twist[3:]), _left(twist[3:]) @ twist[:3])


def log(T: Array) -> Array:
    """Return the (6,) twist whose motion is a (4, 4) transformation; the inverse of `exp`."""
    turn = rotation_vectors(T[:3, :3])
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
    turn = rotation_vectors(T[:3, :3] @ T_from[:3, :3].T)
    return np.concatenate((T[:3, 3] - T_from[:3, 3], turn))


def perturbed(T: Array, by: Array) -> Array:
    """Return a (4, 4) pose moved by a (6,) `perturbation`."""
    return compose(rotations(by[3:]) @ T[:3, :3], T[:3, 3] + by[:3])


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
