"""Poses of scans on nodes: what goes in comes out, also on another node."""
import numpy as np

from sgor_ros.core.common import se3
from sgor_ros.mapping.scan_poses import ScanPoses


def pose(rng):
    return se3.exp(rng.normal(size=6))


def test_what_goes_in_comes_out_bit_by_bit():
    rng, scans = np.random.default_rng(0), ScanPoses()
    poses = [pose(rng) for _ in range(50)]
    for i, T in enumerate(poses):
        scans.add(2**62 + i, i // 3, T)
    assert len(scans) == 50
    np.testing.assert_array_equal(scans.T_node_sensor, poses)
    np.testing.assert_array_equal(scans.nodes, np.arange(50) // 3)
    np.testing.assert_array_equal(scans.stamps_ns, 2**62 + np.arange(50))
    node, T = scans.last()
    assert node == 16
    np.testing.assert_array_equal(T, poses[-1])


def test_before_the_first_there_are_none():
    scans = ScanPoses()
    assert scans.T_node_sensor.shape == (0, 4, 4)
    assert scans.stamps_ns.shape == scans.nodes.shape == (0,)


def test_on_another_node_they_stay_where_they_are():
    rng, scans = np.random.default_rng(1), ScanPoses()
    T_map_node = {node: pose(rng) for node in (3, 4, 5)}
    poses = [pose(rng) for _ in range(6)]
    for i, T in enumerate(poses):
        scans.add(i, 3 + i % 3, T)
    before = [T_map_node[node] @ T for node, T in zip(
        scans.nodes.tolist(), scans.T_node_sensor, strict=True)]
    scans.move({node: (4, se3.inverse(T_map_node[4]) @ T_map_node[node]) for node in (3, 5)})
    np.testing.assert_array_equal(scans.nodes, 4)
    np.testing.assert_allclose(T_map_node[4] @ scans.T_node_sensor, before, atol=1e-12)
    np.testing.assert_array_equal(scans.T_node_sensor[1], poses[1])
