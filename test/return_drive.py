"""A street that is driven down and, in the other lane, back: scans and maps for tests."""
from dataclasses import replace
from functools import cache

import numpy as np

from sgor_ros import Mapper
from sgor_ros import SemanticScan
from sgor_ros.mapping.edge import Edge
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


def shifted(known, T):
    """Return a map whose frame is another."""
    nodes = {node.id: replace(node, T_map_sensor=T @ node.T_map_sensor)
             for node in known.nodes.values()}
    return replace(known, nodes=nodes)


def twice(known, T, copied=None):
    """Return a map with a second floor at T_map_floor, on which some nodes look the same.

    Stairs lead there, of which little is known.
    """
    offset = max(known.nodes) + 1
    copied = list(known.nodes) if copied is None else copied
    nodes = {**known.nodes, **{node + offset: replace(shifted(known, T).nodes[node],
                                                      id=node + offset) for node in copied}}
    edges = [replace(edge, target=edge.target + offset, source=edge.source + offset)
             for edge in known.edges if {edge.target, edge.source} <= set(copied)]
    T_node = known.nodes[copied[0]].T_map_sensor
    stairs = Edge(copied[0], copied[0] + offset, np.linalg.inv(T_node) @ T @ T_node,
                  np.diag([25.0] * 3 + [0.1] * 3))
    keyframes = known.keyframes.copy()
    for one in known.keyframes:
        if one.id in copied:
            keyframes.put(replace(one, id=one.id + offset))
    return replace(known, nodes=nodes, edges=(*known.edges, *edges, stairs), keyframes=keyframes)
