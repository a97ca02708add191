"""A street that is driven down and, in the other lane, back: scans for tests of loops."""
from functools import cache

import numpy as np

from sgor_ros.world import Lidar
from sgor_ros.world.return_trip import there_and_back
from sgor_ros.world.street import loop_trajectory
from sgor_ros.world.street import street_scene

LANE_M = 2.6
THERE, TURN = 22, 8


@cache
def return_drive():
    """Return (points, labels, T_world_sensor) of scans 2 m apart, 42 m there and back."""
    scene, lidar, rng = street_scene(0), Lidar(beams=32, columns=900), np.random.default_rng(0)
    poses = there_and_back(loop_trajectory(scene, THERE, speed=20.0), LANE_M, TURN)
    return [(*lidar.scan(scene, T, rng), T) for T in poses]
