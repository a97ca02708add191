"""Where a sensor is while it sweeps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]


def poses_during(T_world_start: Array, twist: npt.ArrayLike, times: Array) -> tuple[Array, Array]:
    """Move on with a constant twist.

    Parameters
    ----------
    T_world_start : (4, 4) array
        Pose of the sensor at time 0, translation in m.
    twist : (6,) array_like
        Velocity (m/s), then angular velocity (rad/s), in the sensor frame.
    times : (N,) array
        Times, s.

    Returns
    -------
    (N, 3, 3) array, (N, 3) array
        Rotation and translation, m, of T_world_sensor at each time.
    """
    v, w = np.asarray(twist, float).reshape(2, 3)
    rate = float(np.linalg.norm(w))
    axis = w / max(rate, 1e-300)
    along = axis * (axis @ v)
    half = rate * times[:, None] / 2
    # Integral of the turning velocity: an arc across the axis, straight on along it.
    way = times[:, None] * (along + np.sinc(2 * half / np.pi) * (v - along)
                            + half * np.sinc(half / np.pi) ** 2 * np.cross(axis, v))
    turn = Rotation.from_rotvec(times[:, None] * w).as_matrix()
    R, t = T_world_start[:3, :3], T_world_start[:3, 3]
    return R @ turn, way @ R.T + t


def unbend(points: npt.ArrayLike, times: Array, twist: npt.ArrayLike) -> Array:
    """Move points (N, 3), m, each from the sensor's frame at its time, s, into that of time 0."""
    R, t = poses_during(np.eye(4), twist, times)
    return np.asarray(np.einsum('nij,nj->ni', R, np.asarray(points, float)) + t)
