"""A street that is driven down and, in the other lane, back: scans for tests of loops."""
from functools import cache

import numpy as np

from sgor_ros import Mapper
from sgor_ros import SemanticScan
from sgor_ros.world import Lidar
from sgor_ros.world.return_trip import there_and_back
from sgor_ros.world.street import loop_trajectory
from sgor_ros.world.street import street_scene

LANE_M = 2.6
THERE, TURN = 22, 8
PERIOD_NS = 100_000_000


@cache
def return_drive():
    """Return (points, labels, T_world_sensor) of scans 2 m apart, 42 m there and back."""
    scene, lidar, rng = street_scene(0), Lidar(beams=32, columns=900), np.random.default_rng(0)
    poses = there_and_back(loop_trajectory(scene, THERE, speed=20.0), LANE_M, TURN)
    return [(*lidar.scan(scene, T, rng), T) for T in poses]


@cache
def known_map():
    """Return the map of the way there, in the frame of its first scan."""
    return mapped(return_drive()[:THERE]).map


def mapped(scans, mapper=None, start=0):
    """Return a mapper that has seen some scans, by default a new one."""
    mapper = mapper or Mapper()
    for i, (points, labels, _) in enumerate(scans, start):
        mapper.track(SemanticScan(points, labels), i * PERIOD_NS)
    return mapper
