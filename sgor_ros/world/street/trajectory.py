"""A drive around the loop of a scene."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from .layout import resample_closed
from .scene import StreetScene

Array = npt.NDArray[np.float64]

SENSOR_HEIGHT = 1.73  # m above the road
_LANE = 1.3  # m to the right of the centre line
_WANDER = 0.2  # m, so that a second lap is not the first over again
_WANDER_LENGTH = 83.0  # m
_WHEELS = np.array([(1.35, 0.75), (1.35, -0.75), (-1.35, 0.75), (-1.35, -0.75)])  # m


def loop_trajectory(scene: StreetScene, n_scans: int, speed: float = 6.0,
                    period: float = 0.1) -> Array:
    """Drive around the loop in the right-hand lane, again and again if need be.

    Parameters
    ----------
    scene : StreetScene
        Where to drive.
    n_scans : int
        Number of poses.
    speed : float
        Speed, m/s.
    period : float
        Time between poses, s.

    Returns
    -------
    (n_scans, 4, 4) array
        T_world_sensor: x ahead, y left, z up, 1.73 m above the road, which it follows
        in pitch and roll; translations in m.
    """
    layout = scene.layout
    heading = layout.loop.heading
    right = np.column_stack([np.sin(heading), -np.cos(heading)])
    lane = resample_closed(layout.loop.axis + _LANE * right, 1.0)
    path, lap = _closed_spline(lane)

    along = speed * period * np.arange(n_scans)
    ahead = path(along % lap, 1)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    turn = 2 * np.pi / _WANDER_LENGTH
    spot = path(along % lap) + _WANDER * np.sin(turn * along)[:, None] * left
    ahead = ahead + _WANDER * turn * np.cos(turn * along)[:, None] * left
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])

    wheels = spot[:, None] + _WHEELS @ np.stack([ahead, left], axis=1)
    height = layout.road_height(wheels.reshape(-1, 2)).reshape(-1, 4)
    # The least-squares slope over the wheels gives pitch and roll.
    rise = height @ _WHEELS / np.sum(_WHEELS ** 2, axis=0)
    x = _unit(np.column_stack([ahead, rise[:, 0]]))
    z = _unit(np.cross(x, np.column_stack([left, rise[:, 1]])))

    poses = np.tile(np.eye(4), (n_scans, 1, 1))
    poses[:, :3, 0] = x
    poses[:, :3, 1] = np.cross(z, x)
    poses[:, :3, 2] = z
    poses[:, :3, 3] = np.column_stack([spot, height.mean(axis=1)]) + SENSOR_HEIGHT * z
    return poses


def _closed_spline(points: Array) -> tuple[CubicSpline, float]:
    """Smooth closed curve through points (M, 2), m, over arc length, and its length, m."""
    ring = np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    return CubicSpline(along, ring, bc_type='periodic'), float(along[-1])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
