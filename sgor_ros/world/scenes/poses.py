"""Where a sensor stands and drives in a place."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .place import Place
from .plot import clear_of

Array = npt.NDArray[np.float64]

_TILT = np.deg2rad(1.0)  # standard deviation of pitch and roll
_ATTEMPTS = 4000
_BASE = 1.35  # m before and behind, over which the ground gives the pitch
# waves of a drive: length (m), amplitude (m or rad), phase (rad)
_WANDER = (83.0, 0.15, 0.3)
_PITCH, _ROLL = (17.0, np.deg2rad(0.4), 1.0), (23.0, np.deg2rad(0.5), 2.0)


def random_pair(place: Place, rng: np.random.Generator, low: float, high: float
                ) -> tuple[Array, Array]:
    """Draw two poses in one place, any yaw, tilted by a degree or so.

    Parameters
    ----------
    place : Place
        Where.
    rng : numpy.random.Generator
        Source of chance.
    low, high : float
        Their distance lies between, every one as likely, m.

    Returns
    -------
    (4, 4) array, (4, 4) array
        T_world_sensor, both clear of all that stands there.

    Raises
    ------
    ValueError
        If the place has no room for two sensors so far apart.
    """
    distance = rng.uniform(low, high)
    a = rng.uniform(place.area[::2], place.area[1::2], (_ATTEMPTS, 2))
    course = rng.uniform(0.0, 2 * np.pi, _ATTEMPTS)
    # The heights differ by little, and what differs is taken off the way in the plane.
    b = a + distance * np.column_stack([np.cos(course), np.sin(course)])
    inside = np.flatnonzero(_inside(place, b))
    for index in inside:
        pair = np.stack([a[index], b[index]])
        if clear_of(place.boxes, pair, place.clearance).all():
            return _stand(place, pair[0], rng), _stand(place, pair[1], rng)
    raise ValueError(f'no room for two sensors {distance:.2f} m apart')


def random_pose(place: Place, rng: np.random.Generator) -> Array:
    """Draw a pose T_world_sensor (4, 4), any yaw, tilted by a degree or so."""
    for spot in rng.uniform(place.area[::2], place.area[1::2], (_ATTEMPTS, 2)):
        if clear_of(place.boxes, spot[None], place.clearance).all():
            return _stand(place, spot, rng)
    raise ValueError('no room for a sensor')


def drive(place: Place, n_scans: int, step: float) -> Array:
    """Drive along the path, round and round where it is closed.

    Parameters
    ----------
    place : Place
        Where.
    n_scans : int
        Number of poses.
    step : float
        Way between two of them, m.

    Returns
    -------
    (n_scans, 4, 4) array
        T_world_sensor: x ahead, y left, z up, swaying and nodding a little.

    Raises
    ------
    ValueError
        If an open path is shorter than the drive.
    """
    path = np.vstack([place.path, place.path[:1]]) if place.closed else place.path
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    total, way = along[-1], step * (n_scans - 1)
    if not place.closed and way > total:
        raise ValueError(f'{n_scans} scans, {step:g} m apart, are more than the path of '
                         f'{total:.0f} m')
    travelled: Array = step * np.arange(n_scans, dtype=np.float64)
    at = travelled % total if place.closed else (total - way) / 2 + travelled

    def point(s: Array) -> Array:
        s = s % total if place.closed else s
        return np.column_stack([np.interp(s, along, path[:, k]) for k in range(2)])

    ahead = _unit(point(at + 0.2) - point(at - 0.2))
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    length, amplitude, phase = _WANDER
    turn = 2 * np.pi / length
    spot: Array = point(at) + amplitude * np.sin(turn * travelled + phase)[:, None] * left
    course = np.arctan2(ahead[:, 1], ahead[:, 0])
    course += np.arctan(amplitude * turn * np.cos(turn * travelled + phase))
    return _poses(place, spot, course, _wave(_PITCH, travelled), _wave(_ROLL, travelled))


def _wave(wave: tuple[float, float, float], along: Array) -> Array:
    length, amplitude, phase = wave
    return np.asarray(amplitude * np.sin(2 * np.pi * along / length + phase))


def _inside(place: Place, xy: Array) -> npt.NDArray[np.bool_]:
    low, high = np.array(place.area[::2]), np.array(place.area[1::2])
    return np.asarray(((xy >= low) & (xy <= high)).all(axis=1))


def _stand(place: Place, spot: Array, rng: np.random.Generator) -> Array:
    pitch, roll = rng.normal(0.0, _TILT, (2, 1))
    return np.asarray(_poses(place, spot[None], rng.uniform(0.0, 2 * np.pi, 1), pitch, roll)[0])


def _poses(place: Place, spot: Array, yaw: Array, pitch: Array, roll: Array) -> Array:
    """Poses (N, 4, 4) above spots (N, 2), level or in the slope of the ground, tilted further."""
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw)])
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    rise, bank = ((place.ground_height(spot + _BASE * way)
                   - place.ground_height(spot - _BASE * way)) / (2 * _BASE)
                  * place.follows_slope for way in (ahead, left))
    x = _unit(np.column_stack([ahead, np.tan(np.arctan(rise) + pitch)]))
    y = np.column_stack([left, np.tan(np.arctan(bank) + roll)])
    z = _unit(np.cross(x, y))
    poses = np.tile(np.eye(4), (len(spot), 1, 1))
    poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = x, np.cross(z, x), z
    poses[:, :2, 3] = spot
    poses[:, 2, 3] = place.ground_height(spot) + place.sensor_height
    return poses


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
