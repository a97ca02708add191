"""A labelled street world, scanned by a simulated LiDAR, that needs no download."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from .lidar import Lidar
from .scene import Scene
from .scene import street_scene
from .trajectory import loop_trajectory

__all__ = ['Lidar', 'Scene', 'loop_trajectory', 'simulate', 'street_scene']

_LIDAR = Lidar()
_PERIOD = 0.1  # s


def simulate(
    n_scans: int, seed: int = 0, lidar: Lidar = _LIDAR, speed: float = 6.0,
) -> Iterator[tuple[
    float, npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.float64],
]]:
    """Drive around the place of a seed and scan it ten times a second.

    Parameters
    ----------
    n_scans : int
        Number of scans.
    seed : int
        Chooses the place and the noise; the same seed gives the same scans.
    lidar : Lidar
        The sensor.
    speed : float
        Speed, m/s.

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
    scene = street_scene(seed)
    rng = np.random.default_rng([seed, 1])
    for index, pose in enumerate(loop_trajectory(scene, n_scans, speed, _PERIOD)):
        points, labels = lidar.scan(scene, pose, rng)
        yield index * _PERIOD, points, labels, pose
