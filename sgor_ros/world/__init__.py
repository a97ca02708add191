"""A labelled world, scanned by a simulated LiDAR, that needs no download."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from . import scenes
from .lidar import Lidar
from .return_trip import there_and_back
from .scene import Scene
from .street import loop_trajectory
from .street import street_scene

__all__ = ['STREET', 'Lidar', 'Scene', 'loop_trajectory', 'scenes', 'simulate', 'street_scene']

STREET = 'street'
_LIDAR = Lidar()
_PERIOD = 0.1  # s
_SPEED = 6.0  # m/s
_LANE, _TURN = 2.6, 20  # m, scans


def simulate(
    n_scans: int, seed: int = 0, lidar: Lidar = _LIDAR, speed: float | None = None,
    place: str = STREET, back: bool = False,
) -> Iterator[tuple[
    float, npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.float64],
]]:
    """Drive through the place of a seed and scan it ten times a second.

    Parameters
    ----------
    n_scans : int
        Number of scans.
    seed : int
        Chooses the place and the noise; the same seed gives the same scans.
    lidar : Lidar
        The sensor.
    speed : float, optional
        Speed, m/s; if not given 6 on the street, and what a kind of place is made for.
    place : str
        'street', or one of `scenes.KINDS`.
    back : bool
        Whether the second half of the scans is the way back, in the other lane: street only.

    Yields
    ------
    stamp : float
        Time since the start, s.
    points : (N, 3) array of float32
        Returns in the sensor frame, m.
    labels : (N,) array of uint32
        Raw SemanticKITTI label of each point.
    T_world_sensor : (4, 4) array
        True pose of the sensor, translation in m.
    """
    rng = np.random.default_rng([seed, 1])
    scene: Scene
    if place == STREET:
        scene = street = street_scene(seed)
        forth = (n_scans - _TURN) // 2 if back else n_scans
        poses = loop_trajectory(street, forth, _SPEED if speed is None else speed, _PERIOD)
        if back:
            poses = there_and_back(poses, _LANE, n_scans - 2 * forth)
    else:
        scene = there = scenes.make(place, seed)
        step = scenes.KINDS[place].step if speed is None else speed * _PERIOD
        poses = scenes.drive(there, n_scans, step)
    for index, pose in enumerate(poses):
        points, labels = lidar.scan(scene, pose, rng)
        yield index * _PERIOD, points, labels, pose
