"""Drives with the sensor mounted otherwise, and in rain."""
from pathlib import Path

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.io.scans import read_scan
from sgor_ros.io.trajectories import read_kitti
from sgor_ros.world.disturbances import early_returns

PERIOD_NS = 100_000_000


def drive(data_folder, name, count):
    """Return points and poses of the first scans of a drive."""
    folder = Path(data_folder).parent / 'drives' / name
    if not folder.is_dir():
        pytest.skip(f'no {folder}')
    files = sorted((folder / 'velodyne').glob('*.bin'))[:count]
    return [read_scan(file).points for file in files], read_kitti(folder / 'poses.txt')[:count]


def tracked(scans):
    tracker = Tracker()
    return [tracker.track(scan, i * PERIOD_NS) for i, scan in enumerate(scans)]


@pytest.mark.parametrize(('angles', 'told'), [
    ((0, 0, 0), False), ((180, 0, 0), False), ((0, 90, 0), True), ((90, 0, 0), True)])
def test_a_courtyard_with_the_sensor_mounted_otherwise(data_folder, angles, told):
    """Upside down by itself, on its side with the mount told: 18 of 20 scans upright, so 16."""
    clouds, poses = drive(data_folder, 'courtyard', 20)
    M = np.eye(4)
    M[:3, :3] = Rotation.from_euler('xyz', angles, degrees=True).as_matrix()
    up = M[:3, :3] @ [0, 0, 1.0] if told else None
    results = tracked([SemanticScan(points @ M[:3, :3].T.astype(np.float32), up=up)
                       for points in clouds])
    assert sum(result.success for result in results) >= 16
    for i, result in enumerate(results):
        if result.success and result.track_id == 0:
            T = np.linalg.inv(M) @ result.T_odom_sensor @ M
            assert errors(T, relative(poses[0], poses[i]))[0] < 0.5


def test_rain(data_folder):
    """5 % of the rays return early: ten of ten scans tracked, to 0.3 m."""
    clouds, poses = drive(data_folder, 'kitti_08b', 10)
    rng = np.random.default_rng(0)
    wet = []
    for points in clouds:
        ranges = np.linalg.norm(points, axis=1).astype(np.float64)
        drops, _ = early_returns(ranges, np.zeros(len(points), np.uint32), 0.05, (1.0, 120.0), rng)
        wet.append(points * (drops / np.maximum(ranges, 1e-6))[:, None].astype(np.float32))
        assert 0.03 < (drops < ranges).mean() < 0.06
    results = tracked([SemanticScan(points) for points in wet])
    assert [result.success for result in results] == [True] * 10
    for i, result in enumerate(results):
        assert errors(result.T_odom_sensor, relative(poses[0], poses[i]))[0] < 0.3
