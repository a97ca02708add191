"""The simulated street: truth and measurement must agree."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from sgor_ros.world import Lidar
from sgor_ros.world import loop_trajectory
from sgor_ros.world import simulate
from sgor_ros.world import street_scene

CLASSES = {10, 40, 48, 50, 51, 70, 71, 72, 80, 81, 99}
ROAD = 40
SMALL = Lidar(beams=32, columns=360)
CLEAN = Lidar(beams=64, columns=900, range_noise=0.0, drop_out=0.0)


@pytest.fixture(scope='module')
def places():
    return street_scene(0), street_scene(1)


@pytest.fixture(scope='module')
def scene(places):
    return places[0]


def to_world(points, pose):
    return points @ pose[:3, :3].T + pose[:3, 3]


def test_same_seed_gives_the_same_scans():
    first, second = (list(simulate(2, seed=3, lidar=SMALL)) for _ in range(2))
    for (stamp_a, *a), (stamp_b, *b) in zip(first, second, strict=True):
        assert stamp_a == stamp_b
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)
    assert first[1][0] == pytest.approx(0.1)
    assert not np.array_equal(first[0][1][:100], first[1][1][:100])


def test_scan_shapes_and_types(scene):
    points, labels = SMALL.scan(scene, loop_trajectory(scene, 1)[0], np.random.default_rng(0))
    assert points.dtype == np.float32
    assert labels.dtype == np.uint32
    assert points.shape == (len(labels), 3)
    reach = np.linalg.norm(points, axis=1)
    assert reach.max() < SMALL.max_range + 0.2
    elevation = np.arcsin(points[:, 2] / reach)
    assert elevation.max() == pytest.approx(SMALL.fov_up, abs=1e-4)
    assert elevation.min() == pytest.approx(SMALL.fov_down, abs=1e-4)


def test_short_range_sensor_sees_nothing_beyond(scene):
    near = Lidar(beams=16, columns=360, max_range=12.0, range_noise=0.0)
    points, _ = near.scan(scene, loop_trajectory(scene, 1)[0], np.random.default_rng(0))
    assert 11.0 < np.linalg.norm(points, axis=1).max() < 12.0


def test_points_moved_by_the_true_pose_lie_on_the_scene(scene):
    for pose in loop_trajectory(scene, 301)[::100]:
        points, _ = CLEAN.scan(scene, pose, np.random.default_rng(0))
        world = to_world(points, pose).astype(np.float32)
        distance = scene.raycaster.compute_distance(o3d.core.Tensor.from_numpy(world)).numpy()
        assert distance.max() < 0.002


def test_true_poses_lay_scans_on_the_same_surfaces_and_classes(scene):
    poses = loop_trajectory(scene, 6)
    rng = np.random.default_rng(0)
    (a, label_a), (b, label_b) = (CLEAN.scan(scene, poses[k], rng) for k in (0, 5))
    # Close by, the points of either scan are dense enough to compare.
    near = np.linalg.norm(b, axis=1) < 9.0
    tree = cKDTree(to_world(a, poses[0]))
    distance, index = tree.query(to_world(b[near], poses[5]))
    assert np.median(distance) < 0.06
    same = distance < 0.05
    assert same.mean() > 0.3
    assert (label_a[index[same]] == label_b[near][same]).mean() > 0.97
    # A pose that is a metre off must not fit as well, away from the flat road.
    upright = near & ~np.isin(label_b, [40, 48, 72])
    good, _ = tree.query(to_world(b[upright], poses[5]))
    wrong, _ = tree.query(to_world(b[upright], poses[5]) + [0.7, 0.7, 0.0])
    assert np.median(good) < 0.08
    assert np.median(wrong) > 2.0 * np.median(good)


def test_range_noise_has_the_asked_spread(scene):
    pose = loop_trajectory(scene, 1)[0]
    still = Lidar(beams=32, columns=360, range_noise=0.0, drop_out=0.0)
    shaky = Lidar(beams=32, columns=360, range_noise=0.05, drop_out=0.0)
    a, _ = still.scan(scene, pose, np.random.default_rng(1))
    b, _ = shaky.scan(scene, pose, np.random.default_rng(1))
    error = np.linalg.norm(b, axis=1) - np.linalg.norm(a, axis=1)
    assert error.std() == pytest.approx(0.05, rel=0.05)
    assert abs(error.mean()) < 0.003


@pytest.mark.parametrize('share', [0.0, 0.2])
def test_drop_out_loses_the_asked_share(scene, share):
    pose = loop_trajectory(scene, 1)[0]
    full = Lidar(beams=32, columns=720, drop_out=0.0, range_noise=0.0)
    some = Lidar(beams=32, columns=720, drop_out=share, range_noise=0.0)
    kept, _ = some.scan(scene, pose, np.random.default_rng(2))
    every, _ = full.scan(scene, pose, np.random.default_rng(2))
    assert 1 - len(kept) / len(every) == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize('share', [0.0, 0.1, 0.5])
def test_label_noise_changes_the_asked_share(scene, share):
    pose = loop_trajectory(scene, 1)[0]
    noisy = Lidar(beams=32, columns=720, label_noise=share)
    sure = Lidar(beams=32, columns=720)
    points, labels = noisy.scan(scene, pose, np.random.default_rng(2))
    same, truth = sure.scan(scene, pose, np.random.default_rng(2))
    np.testing.assert_array_equal(points, same)
    assert (labels != truth).mean() == pytest.approx(share, abs=0.015)
    assert set(labels.tolist()) <= CLASSES


@pytest.mark.parametrize('seed', [0, 1])
def test_sensor_rides_above_the_road(places, seed):
    place = places[seed]
    rng = np.random.default_rng(0)
    for pose in loop_trajectory(place, 500)[::50]:
        points, labels = SMALL.scan(place, pose, rng)
        under = (labels == ROAD) & (np.linalg.norm(points[:, :2], axis=1) < 5.0)
        assert under.sum() > 100
        assert np.median(points[under, 2]) == pytest.approx(-1.73, abs=0.03)


def test_all_classes_are_seen_around_the_loop(scene):
    rng = np.random.default_rng(0)
    count = dict.fromkeys(CLASSES, 0)
    for pose in loop_trajectory(scene, 560)[::40]:
        _, labels = Lidar(beams=64, columns=360).scan(scene, pose, rng)
        for label, number in zip(*np.unique(labels, return_counts=True), strict=True):
            count[int(label)] += int(number)
    assert set(count) == CLASSES == set(scene.label_of_geometry.tolist())
    assert min(count.values()) > 20, count
    # No class may drown the others.
    assert max(count.values()) < 0.6 * sum(count.values()), count


def test_seeds_are_different_places(places):
    scene, other = places
    a = scene.layout.loop.axis
    apart, _ = cKDTree(other.layout.loop.axis).query(a)
    assert np.median(apart) > 3.0
    scans = [SMALL.scan(s, loop_trajectory(s, 1)[0], np.random.default_rng(0))[0]
             for s in (scene, other)]
    standing = [p[p[:, 2] > -1.0] for p in scans]
    distance, _ = cKDTree(standing[0]).query(standing[1])
    assert np.median(distance) > 0.5


def test_trajectory_is_smooth_closed_and_of_constant_speed(scene):
    lap = scene.layout.loop.length
    count = int(1.5 * lap / 0.6)
    poses = loop_trajectory(scene, count)
    rotation, position = poses[:, :3, :3], poses[:, :3, 3]
    np.testing.assert_allclose(
        rotation @ rotation.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (count, 3, 3)),
        atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    np.testing.assert_allclose(step, 0.6, rtol=0.05)
    turn = rotation[:-1].transpose(0, 2, 1) @ rotation[1:]
    angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert np.rad2deg(angle).max() < 8.0
    # The nose points where the car goes.
    ahead = np.diff(position, axis=0) / step[:, None]
    assert np.sum(ahead * rotation[:-1, :, 0], axis=1).min() > 0.995
    # Half a lap on, the second lap runs where the first one did.
    again, _ = cKDTree(position[:int(lap / 0.6)]).query(position[int(1.2 * lap / 0.6):])
    assert again.max() < 0.8
    assert np.ptp(position[:, 0]) > 50.0


def test_pitch_and_roll_are_small_but_not_zero(scene):
    poses = loop_trajectory(scene, 500)
    pitch, roll = np.rad2deg(np.arcsin(poses[:, 2, 0])), np.rad2deg(np.arcsin(poses[:, 2, 1]))
    for angle in (pitch, roll):
        assert 0.2 < angle.std()
        assert np.abs(angle).max() < 7.0


def test_speed_and_period_set_the_spacing(scene):
    poses = loop_trajectory(scene, 3, speed=10.0, period=0.2)
    step = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    np.testing.assert_allclose(step, 2.0, rtol=0.05)
