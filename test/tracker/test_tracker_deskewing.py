"""Scans that are bent by the motion of the sensor, tracked with the times of their points."""
from itertools import pairwise

from conftest import errors
from conftest import PERIOD_NS
from conftest import relative
import numpy as np
import pytest

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.core.common import se3
from sgor_ros.world import Lidar
from sgor_ros.world.scenes import make

pytestmark = pytest.mark.slow
COUNT, SPEED = 14, 12.0
BOUND = 20.06    # of chi2 with 6 degrees of freedom at 99.73 %


@pytest.fixture(scope='module')
def drive():
    """Return points, labels, times and T_world_sensor of sweeps in a car that speeds up."""
    place, lidar = make('facade_cars_random', 51), Lidar(beams=32, columns=900)
    rng = np.random.default_rng(0)
    poses = []
    for k in range(COUNT + 1):
        t = 0.1 * k
        way = SPEED * t + t**2    # 2 m/s^2
        pose = np.eye(4)
        pose[:3, 3] = (way - 15, 0.6 * np.sin(way / 10), 1.7)
        yaw = np.arctan(0.06 * np.cos(way / 10))
        pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        poses.append(pose)
    return [(*lidar.sweep(place, T, rng, se3.log(np.linalg.inv(T) @ after) / 0.1), T)
            for T, after in pairwise(poses)]


def tracked(drive, mode, *, times):
    tracker = Tracker(tracker_config=TrackerConfig(mode=mode))
    results = [tracker.track(SemanticScan(points, labels, times=when if times else None),
                             k * PERIOD_NS)
               for k, (points, labels, when, _) in enumerate(drive)]
    return tracker, results


def errors_of(drive, k, result):
    return errors(result.T_odom_sensor, relative(drive[0][3], drive[k][3]))


@pytest.mark.parametrize('mode', ['keyframe', 'consecutive'])
def test_the_bend_is_taken_out_and_what_is_left_is_known(drive, mode):
    tracker, results = tracked(drive, mode, times=True)
    _, bent = tracked(drive, mode, times=False)
    assert all(result.success for result in results)
    metres, degrees = np.transpose([errors_of(drive, k, result)
                                    for k, result in enumerate(results)])
    assert metres.max() < 0.1
    assert degrees.max() < 0.4
    as_it_came = np.mean([errors_of(drive, k, result)[1] for k, result in enumerate(bent)])
    assert degrees.mean() < 0.75 * as_it_came
    outside = 0
    for k, result in enumerate(results[1:], 1):
        of = result.reference_stamp_ns // PERIOD_NS
        error = se3.perturbation(result.T_reference_sensor, relative(drive[of][3], drive[k][3]))
        outside += error @ np.linalg.solve(result.reference_covariance, error) > BOUND
    assert outside <= 1
    assert tracker.reference.prepared.scan.times is None
    assert tracker.reference.prepared.frame_covariance is not None


def test_the_first_scan_is_deskewed_as_soon_as_the_motion_is_known(drive):
    tracker = Tracker()
    points, labels, times, _ = drive[0]
    tracker.track(SemanticScan(points, labels, times=times), 0)
    first = tracker.reference
    np.testing.assert_array_equal(first.prepared.scan.points, points)
    points, labels, times, _ = drive[1]
    tracker.track(SemanticScan(points, labels, times=times), PERIOD_NS)
    again = tracker.reference
    assert again.id == first.id
    velocity = se3.log(relative(drive[0][3], drive[1][3]))[:3] / 0.1
    ahead = np.abs(np.arctan2(*drive[0][0][:, 1::-1].T)) < 0.1
    moved = (again.prepared.scan.points - drive[0][0])[ahead]
    np.testing.assert_allclose(moved.mean(axis=0), drive[0][2][ahead].mean() * velocity, atol=0.1)
    trace = [np.trace(one.prepared.frame_covariance[:3, :3]) for one in (first, again)]
    assert trace[1] < 0.01 * trace[0]


def test_scans_at_rest_lose_nothing_by_their_times(street):
    points, labels, _ = street[0]
    times = np.linspace(0, 0.1, len(points))
    results = [Tracker(), Tracker()]
    for tracker, when in zip(results, (None, times), strict=True):
        for k in range(4):
            last = tracker.track(SemanticScan(points, labels, times=when), k * PERIOD_NS)
        assert errors(last.T_odom_sensor, np.eye(4))[0] < 1e-3
