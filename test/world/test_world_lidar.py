"""What spoils scans, and sweeps, before surfaces at known places."""
from dataclasses import replace

import boxes
from boxes import angles
from boxes import at
from boxes import BUILDING
from boxes import CAR
from boxes import CLEAN
from boxes import clean
from boxes import FENCE
from boxes import rng
from boxes import ROAD
from boxes import TRUCK
import numpy as np
import open3d as o3d
import pytest
from scipy.linalg import expm

from sgor_ros.world import Lidar
from sgor_ros.world import scenes
from sgor_ros.world.motion import poses_during
from sgor_ros.world.motion import unbend
from sgor_ros.world.sensors import SENSORS
from sgor_ros.world.traffic import convoy
from sgor_ros.world.traffic import truck_beside

TWIST = np.array([15.0, -1.0, 0.5, 0.1, -0.2, 0.8])    # m/s, rad/s


def test_the_default_scan_is_what_it_was_before_there_were_sensors():
    """Point by point, bit by bit, as the first version drew and cast them."""
    yard, lidar = scenes.make('courtyard', 0), Lidar(columns=450, label_noise=0.1)
    pose, source = scenes.drive(yard, 1, 0.3)[0], rng(5)
    elevation = np.linspace(lidar.fov_up, lidar.fov_down, 64)[:, None]
    azimuth = -2 * np.pi * (np.arange(450) + source.random()) / 450
    rays = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                     np.broadcast_to(np.sin(elevation), (64, 450))], axis=-1).reshape(-1, 3)
    lines = np.empty((len(rays), 6), np.float32)
    lines[:, :3], lines[:, 3:] = pose[:3, 3], rays @ pose[:3, :3].T
    hits = yard.raycaster.cast_rays(o3d.core.Tensor.from_numpy(lines))
    reach = hits['t_hit'].numpy().astype(np.float64)
    seen = np.flatnonzero((reach < 100.0) & (source.random(len(rays)) >= 0.05))
    reach = reach[seen] + 0.02 * source.standard_normal(len(seen))
    truth = yard.label_of_geometry[hits['geometry_ids'].numpy()[seen]]
    known, wrong = np.unique(yard.label_of_geometry), source.random(len(seen)) < 0.1
    shift = source.integers(1, len(known), len(seen))
    other = known[(np.searchsorted(known, truth) + shift) % len(known)]
    points, labels = lidar.scan(yard, pose, rng(5))
    np.testing.assert_array_equal(points, (reach[:, None] * rays[seen]).astype(np.float32))
    np.testing.assert_array_equal(labels, np.where(wrong, other, truth))
    # those that are told apart by name only are the same sensor
    np.testing.assert_array_equal(SENSORS['HDL-64E'].scan(yard, pose, rng(5))[0],
                                  Lidar().scan(yard, pose, rng(5))[0])


@pytest.mark.parametrize('share', [0.01, 0.1, 0.4])
def test_rain_returns_early_anywhere_on_the_way(share):
    sensor = replace(CLEAN, columns=1800)
    dry, _ = sensor.scan(boxes.room(), np.eye(4), rng())
    wet, labels = replace(sensor, early_returns=share).scan(boxes.room(), np.eye(4), rng())
    reach, truth = np.linalg.norm(wet, axis=1), np.linalg.norm(dry, axis=1)
    early = labels == 0
    assert early.mean() == pytest.approx(share, rel=0.1)
    np.testing.assert_array_equal(wet[~early], dry[~early])
    along = (reach[early] - 1.0) / (truth[early] - 1.0)
    np.testing.assert_allclose(np.quantile(along, [0.0, 0.25, 0.5, 0.75, 1.0]),
                               [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.08)


def test_rain_is_seen_against_the_sky():
    sensor = replace(CLEAN, max_range=50.0, early_returns=0.2)
    points, labels = sensor.scan(boxes.floor(), at(z=2.0), rng())
    up = points[:, 2] > 0
    assert (labels[up] == 0).all()
    assert up.sum() == pytest.approx(0.2 * 8 * 720, rel=0.1)
    assert 1.0 <= np.linalg.norm(points, axis=1)[up].min()


def test_ghosts_are_the_mirror_image_behind_the_mirror():
    """Seen in the wall at x = 10, the one at x = -20 stands at x = 40; and the other way round."""
    truth, _ = CLEAN.scan(boxes.walls(), np.eye(4), rng())
    points, labels = replace(CLEAN, ghosts=0.2).scan(boxes.walls(), np.eye(4), rng())
    x = points[:, 0]
    front, back = x > 0, x < 0
    behind = np.where(front, x > 11.0, x < -21.0)
    assert behind.mean() == pytest.approx(0.2, abs=0.03)
    np.testing.assert_allclose(x[front & behind], 40.0, rtol=1e-4)
    np.testing.assert_allclose(x[back & behind], -50.0, rtol=1e-4)
    np.testing.assert_allclose(x[front & ~behind], 10.0, rtol=1e-4)
    assert set(labels[front & behind]) == {FENCE} == set(labels[back & ~behind])
    assert set(labels[back & behind]) == {BUILDING} == set(labels[front & ~behind])
    assert len(points) <= len(truth)


def test_a_mirror_of_nothing_returns_nothing():
    dry, _ = CLEAN.scan(boxes.floor(), at(z=2.0), rng())
    wet, _ = replace(CLEAN, ghosts=0.3).scan(boxes.floor(), at(z=2.0), rng())
    assert len(wet) / len(dry) == pytest.approx(0.7, abs=0.03)
    np.testing.assert_allclose(wet[:, 2], -2.0, rtol=1e-4)


@pytest.mark.parametrize('twist', [TWIST, [20.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 3.0],
                                   [5.0, 1.0, 0, 0, 0, 1e-9]])
def test_the_sensor_moves_along_the_exponential_of_its_twist(twist):
    (vx, vy, vz), (a, b, c) = np.reshape(twist, (2, 3))
    hat = np.array([[0, -c, b, vx], [c, 0, -a, vy], [-b, a, 0, vz], [0, 0, 0, 0]], float)
    start = expm(np.array([[0, -1, 0, 3], [1, 0, -0.5, 2], [0, 0.5, 0, 1], [0, 0, 0, 0]], float))
    times = np.linspace(0.0, 0.1, 7)
    R, t = poses_during(start, twist, times)
    for k, seconds in enumerate(times):
        T = start @ expm(hat * seconds)
        np.testing.assert_allclose(R[k], T[:3, :3], atol=1e-12)
        np.testing.assert_allclose(t[k], T[:3, 3], atol=1e-12)


def test_a_wall_seen_at_20_metres_a_second_bends_by_speed_times_time():
    points, labels, times = CLEAN.sweep(boxes.walls(), np.eye(4), rng(), [20.0, 0, 0, 0, 0, 0],
                                        0.1)
    ahead = labels == BUILDING
    near = np.linalg.norm(points, axis=1) < 50.0    # float32 over there
    np.testing.assert_allclose(points[ahead & near, 0], 10.0 - 20.0 * times[ahead & near],
                               atol=1e-4)
    assert np.ptp(points[ahead & near, 0]) > 1.9
    assert times.min() == 0.0
    assert times.max() == pytest.approx(0.1 * 719 / 720)


def test_a_sweep_goes_round_with_the_time():
    points, _, times = CLEAN.sweep(boxes.room(), np.eye(4), rng(), np.zeros(6), 0.1)
    azimuth, _ = angles(points)
    turned = -azimuth % 360.0
    np.testing.assert_allclose(turned - 3600.0 * times, (turned - 3600.0 * times)[0], atol=0.01)
    # a sector takes as long, from the left to the right
    points, _, times = replace(CLEAN, fov_horizontal=np.pi / 2).sweep(
        boxes.room(), np.eye(4), rng(), np.zeros(6), 0.1)
    azimuth, _ = angles(points)
    np.testing.assert_allclose(azimuth, 45.0 - 900.0 * times, atol=0.51)


@pytest.mark.parametrize('name', ['VLP-16', 'Avia', 'Mid-360'])
def test_a_bent_scan_unbent_lies_on_what_a_standing_sensor_sees(name):
    yard, sensor = scenes.make('courtyard', 0), clean(SENSORS[name], 100.0)
    pose = scenes.drive(yard, 1, 0.3)[0]

    def away(points):
        world = points @ pose[:3, :3].T + pose[:3, 3]
        query = o3d.core.Tensor.from_numpy(world.astype(np.float32))
        return yard.raycaster.compute_distance(query).numpy()

    twist = TWIST / [5, 5, 5, 1, 1, 1]    # the yard is small
    points, labels, times = sensor.sweep(yard, pose, rng(), twist)
    assert len(points) == len(labels) == len(times)
    assert away(unbend(points, times, twist)).max() < 0.002
    assert np.quantile(away(points), 0.9) > 0.05


def test_a_sweep_that_stands_still_is_a_scan():
    sensor = Lidar(early_returns=0.1, ghosts=0.1, columns=360)
    points, labels = sensor.scan(boxes.walls(), at(1.0, 2.0, 3.0), rng(4))
    again, same, _ = sensor.sweep(boxes.walls(), at(1.0, 2.0, 3.0), rng(4), np.zeros(6))
    np.testing.assert_allclose(again, points, atol=1e-5)
    np.testing.assert_array_equal(same, labels)


@pytest.mark.parametrize('moving', [False, True])
def test_what_moves_with_the_sensor_is_at_the_same_place_in_each_scan(moving):
    sensor = replace(CLEAN, fov_up=0.4, fov_down=-0.6)
    for pose in (at(z=1.73), at(50.0, -3.0, 1.73)):
        if moving:
            points, labels, _ = sensor.sweep(boxes.floor(), pose, rng(), TWIST / 10,
                                             companions=truck_beside())
        else:
            points, labels = sensor.scan(boxes.floor(), pose, rng(), truck_beside())
        truck = points[labels == TRUCK]
        assert len(truck) > 1000
        # its near side, 3.5 m away and 2.5 m wide, hides what is behind
        np.testing.assert_allclose(truck[:, 1], 2.25, atol=1e-3)
        assert np.abs(truck[:, 0]).max() == pytest.approx(6.0, abs=0.1)
        assert truck[:, 2].min() == pytest.approx(0.3 - 1.73, abs=0.2)
        road = points[labels == ROAD]
        assert not ((road[:, 1] > 4.75) & (np.abs(road[:, 0]) < 5.0)
                    & (road[:, 1] < 12.0)).any()


def test_a_convoy_is_six_cars_around():
    points, labels = CLEAN.scan(boxes.floor(), at(z=1.73), rng(), convoy())
    cars = points[labels == CAR]
    lanes = {(int(np.sign(x)), round(float(y) / 3.5)) for x, y, _ in cars}
    assert lanes == {(side, lane) for side in (-1, 1) for lane in (-1, 0, 1)}
    assert np.abs(cars[:, 0]).min() == pytest.approx(12.0 - 2.25, abs=0.01)


@pytest.mark.parametrize(('wrong', 'message'), [
    ({'elevations': (0.1, 0.0)}, '2 elevations of 64 beams'),
    ({'early_returns': 1.5}, r'early_returns 1\.5: not within 0 and 1'),
    ({'ghosts': -0.1}, r'ghosts -0\.1: not within 0 and 1'),
    ({'drop_out': np.nan}, 'drop_out nan: not within 0 and 1'),
    ({'fov_horizontal': 0.0}, r'fov_horizontal 0\.0: not within 0 and 2 pi')])
def test_a_sensor_that_cannot_be_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Lidar(**wrong)
