"""Sensors, what spoils their scans, and sweeps, before surfaces at known places."""
from dataclasses import replace

import numpy as np
import open3d as o3d
import pytest
from scipy.linalg import expm
from scipy.spatial import cKDTree

from sgor_ros.world import Lidar
from sgor_ros.world import scenes
from sgor_ros.world.motion import poses_during
from sgor_ros.world.motion import unbend
from sgor_ros.world.scene import close
from sgor_ros.world.scene import Scene
from sgor_ros.world.sensors import SENSORS
from sgor_ros.world.shapes import box
from sgor_ros.world.traffic import convoy
from sgor_ros.world.traffic import truck_beside

ROAD, BUILDING, FENCE, CAR, TRUCK = 40, 50, 51, 10, 18
FAR = 400.0
# 16 beams that lose nothing
CLEAN = Lidar(16, 720, 0.25, -0.25, 1000.0, 0.0, 0.0)
SPINNING = [name for name, sensor in SENSORS.items() if type(sensor) is Lidar]
TWIST = np.array([15.0, -1.0, 0.5, 0.1, -0.2, 0.8])    # m/s, rad/s


def clean(sensor, max_range=1000.0):
    return replace(sensor, range_noise=0.0, drop_out=0.0, min_range=0.0, max_range=max_range)


def scene(**solids):
    """Return a scene of boxes given as label=(x, y, z), the label with a letter before it."""
    return Scene(*close({int(label[1:]): [box(*ends)] for label, ends in solids.items()}, {}))


def rng(seed=0):
    return np.random.default_rng(seed)


def at(x=0.0, y=0.0, z=0.0):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def angles(points):
    """Return azimuth and elevation, deg."""
    x, y, z = points.astype(float).T
    return np.rad2deg(np.arctan2(y, x)), np.rad2deg(np.arctan2(z, np.hypot(x, y)))


@pytest.fixture(scope='module')
def room():
    """Return the inside of a cube of 20 m."""
    return scene(b50=((-10, 10), (-10, 10), (-10, 10)))


@pytest.fixture(scope='module')
def floor():
    """Return level ground at z = 0."""
    return scene(r40=((-FAR, FAR), (-FAR, FAR), (-1, 0)))


@pytest.fixture(scope='module')
def walls():
    """Return two walls that face each other, at x = 10 and at x = -20."""
    return scene(b50=((10, 11), (-FAR, FAR), (-FAR, FAR)),
                 f51=((-21, -20), (-FAR, FAR), (-FAR, FAR)))


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


def test_each_beam_of_a_vlp_16_meets_level_ground_at_its_range(floor):
    points, labels = clean(SENSORS['VLP-16']).scan(floor, at(z=2.0), rng())
    assert set(labels) == {ROAD}
    reach = np.linalg.norm(points.astype(float), axis=1).reshape(8, 1800)
    down = np.deg2rad(np.arange(1, 16, 2))
    np.testing.assert_allclose(reach, np.broadcast_to((2.0 / np.sin(down))[:, None], (8, 1800)),
                               rtol=2e-6)


@pytest.mark.parametrize(('name', 'degrees'), [
    ('VLP-16', np.arange(15.0, -16.0, -2.0)),
    ('HDL-32E', [10.67, 9.33, 8.0, 6.67, 5.33, 4.0, 2.67, 1.33, 0.0, -1.33, -2.67, -4.0, -5.33,
                 -6.66, -8.0, -9.33, -10.67, -12.0, -13.33, -14.67, -16.0, -17.33, -18.67, -20.0,
                 -21.33, -22.67, -24.0, -25.33, -26.66, -28.0, -29.33, -30.67]),
    ('Pandar XT-32', np.arange(15.0, -17.0, -1.0))])
def test_beams_are_where_the_manual_says(room, name, degrees):
    points, _ = clean(SENSORS[name]).scan(room, np.eye(4), rng())
    _, elevation = angles(points.reshape(len(degrees), -1, 3)[:, 0])
    np.testing.assert_allclose(elevation, degrees, atol=0.01)


def test_beams_of_a_pandar64_are_dense_at_the_horizon_and_sparse_below(room):
    points, _ = clean(SENSORS['Pandar64']).scan(room, np.eye(4), rng())
    _, elevation = angles(points.reshape(64, 1800, 3)[:, 0])
    gap = -np.diff(elevation)
    np.testing.assert_allclose(gap[(elevation[1:] < 2) & (elevation[1:] > -6)], 1 / 6, atol=0.01)
    assert gap[-1] == pytest.approx(6.008, abs=1e-3)
    assert elevation[0] - elevation[-1] == pytest.approx(39.779, abs=1e-3)


@pytest.mark.parametrize('name', SENSORS)
def test_a_sensor_fills_its_field_of_view_and_no_more(room, name):
    sensor = clean(SENSORS[name])
    points, _ = sensor.scan(room, np.eye(4), rng())
    azimuth, elevation = angles(points)
    assert np.rad2deg(sensor.fov_down) - 1e-3 <= elevation.min()
    assert elevation.max() <= np.rad2deg(sensor.fov_up) + 1e-3
    assert np.ptp(elevation) > 0.97 * np.rad2deg(sensor.fov_up - sensor.fov_down)
    half = np.rad2deg(sensor.fov_horizontal) / 2
    assert np.abs(azimuth).max() <= half + 1e-3
    assert np.ptp(azimuth) > 0.97 * 2 * half
    assert len(points) == sensor.beams * round(sensor.columns * (
        half / 180 if name in SPINNING else 1.0))


@pytest.mark.parametrize('name', SENSORS)
def test_ranges_end_where_the_sheet_says(name):
    sensor = replace(SENSORS[name], range_noise=0.0, drop_out=0.0)
    half = 0.9 * sensor.max_range
    hall = scene(b50=((-half, half),) * 3)
    reach = np.linalg.norm(sensor.scan(hall, np.eye(4), rng())[0], axis=1)
    assert 0.97 * sensor.max_range < reach.max() <= sensor.max_range
    # a plate nearer than the least range returns nothing
    least = sensor.min_range or 0.5
    plate = scene(b50=((-10, 10),) * 3,
                  f51=((0.6 * least, 0.7 * least), *[(-0.2 * least, 0.2 * least)] * 2))
    seen, labels = replace(sensor, min_range=0.0).scan(plate, np.eye(4), rng())
    left, _ = replace(sensor, min_range=least).scan(plate, np.eye(4), rng())
    assert FENCE in labels
    np.testing.assert_array_equal(left, seen[labels != FENCE])


@pytest.mark.parametrize('name', SENSORS)
def test_noise_is_that_of_the_sheet_and_the_seed_decides(room, name):
    sensor = replace(SENSORS[name], drop_out=0.0, min_range=0.0)
    points, _ = sensor.scan(room, np.eye(4), rng(3))
    np.testing.assert_array_equal(points, sensor.scan(room, np.eye(4), rng(3))[0])
    truth, _ = replace(sensor, range_noise=0.0).scan(room, np.eye(4), rng(3))
    error = np.linalg.norm(points, axis=1) - np.linalg.norm(truth, axis=1)
    assert error.std() == pytest.approx(sensor.range_noise, rel=0.05)


@pytest.mark.parametrize('name', ['Avia', 'Mid-360'])
def test_a_livox_looks_elsewhere_in_each_scan(room, name):
    """Ten scans fill gaps that one leaves; ten turns of a spinning one hit the same rings."""
    source, sensor = rng(), clean(SENSORS[name])
    scans = [sensor.scan(room, np.eye(4), source)[0] for _ in range(10)]
    units = [p / np.linalg.norm(p, axis=1, keepdims=True) for p in scans]
    places = np.concatenate(units)[rng(1).integers(10 * len(units[0]), size=2000)]
    one = np.quantile(cKDTree(units[0]).query(places)[0], 0.9)
    ten = np.quantile(cKDTree(np.concatenate(units[1:])).query(
        units[0][::10])[0], 0.9)
    assert ten < 0.6 * one
    *_, times = sensor.sweep(room, np.eye(4), source, np.zeros(6))
    assert (np.diff(times.reshape(sensor.beams, -1), axis=1) > 0).all()
    assert times.max() < 0.1


@pytest.mark.parametrize('share', [0.01, 0.1, 0.4])
def test_rain_returns_early_anywhere_on_the_way(room, share):
    sensor = replace(CLEAN, columns=1800)
    dry, _ = sensor.scan(room, np.eye(4), rng())
    wet, labels = replace(sensor, early_returns=share).scan(room, np.eye(4), rng())
    reach, truth = np.linalg.norm(wet, axis=1), np.linalg.norm(dry, axis=1)
    early = labels == 0
    assert early.mean() == pytest.approx(share, rel=0.1)
    np.testing.assert_array_equal(wet[~early], dry[~early])
    along = (reach[early] - 1.0) / (truth[early] - 1.0)
    np.testing.assert_allclose(np.quantile(along, [0.0, 0.25, 0.5, 0.75, 1.0]),
                               [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.08)


def test_rain_is_seen_against_the_sky(floor):
    sensor = replace(CLEAN, max_range=50.0, early_returns=0.2)
    points, labels = sensor.scan(floor, at(z=2.0), rng())
    up = points[:, 2] > 0
    assert (labels[up] == 0).all()
    assert up.sum() == pytest.approx(0.2 * 8 * 720, rel=0.1)
    assert 1.0 <= np.linalg.norm(points, axis=1)[up].min()


def test_ghosts_are_the_mirror_image_behind_the_mirror(walls):
    """Seen in the wall at x = 10, the one at x = -20 stands at x = 40; and the other way round."""
    truth, _ = CLEAN.scan(walls, np.eye(4), rng())
    points, labels = replace(CLEAN, ghosts=0.2).scan(walls, np.eye(4), rng())
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


def test_a_mirror_of_nothing_returns_nothing(floor):
    dry, _ = CLEAN.scan(floor, at(z=2.0), rng())
    wet, _ = replace(CLEAN, ghosts=0.3).scan(floor, at(z=2.0), rng())
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


def test_a_wall_seen_at_20_metres_a_second_bends_by_speed_times_time(walls):
    points, labels, times = CLEAN.sweep(walls, np.eye(4), rng(), [20.0, 0, 0, 0, 0, 0], 0.1)
    ahead = labels == BUILDING
    near = np.linalg.norm(points, axis=1) < 50.0    # float32 over there
    np.testing.assert_allclose(points[ahead & near, 0], 10.0 - 20.0 * times[ahead & near],
                               atol=1e-4)
    assert np.ptp(points[ahead & near, 0]) > 1.9
    assert times.min() == 0.0
    assert times.max() == pytest.approx(0.1 * 719 / 720)


def test_a_sweep_goes_round_with_the_time(room):
    points, _, times = CLEAN.sweep(room, np.eye(4), rng(), np.zeros(6), 0.1)
    azimuth, _ = angles(points)
    turned = -azimuth % 360.0
    np.testing.assert_allclose(turned - 3600.0 * times, (turned - 3600.0 * times)[0], atol=0.01)
    # a sector takes as long, from the left to the right
    points, _, times = replace(CLEAN, fov_horizontal=np.pi / 2).sweep(
        room, np.eye(4), rng(), np.zeros(6), 0.1)
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


def test_a_sweep_that_stands_still_is_a_scan(walls):
    sensor = Lidar(early_returns=0.1, ghosts=0.1, columns=360)
    points, labels = sensor.scan(walls, at(1.0, 2.0, 3.0), rng(4))
    again, same, _ = sensor.sweep(walls, at(1.0, 2.0, 3.0), rng(4), np.zeros(6))
    np.testing.assert_allclose(again, points, atol=1e-5)
    np.testing.assert_array_equal(same, labels)


@pytest.mark.parametrize('moving', [False, True])
def test_what_moves_with_the_sensor_is_at_the_same_place_in_each_scan(floor, moving):
    sensor = replace(CLEAN, fov_up=0.4, fov_down=-0.6)
    for pose in (at(z=1.73), at(50.0, -3.0, 1.73)):
        if moving:
            points, labels, _ = sensor.sweep(floor, pose, rng(), TWIST / 10,
                                             companions=truck_beside())
        else:
            points, labels = sensor.scan(floor, pose, rng(), truck_beside())
        truck = points[labels == TRUCK]
        assert len(truck) > 1000
        # its near side, 3.5 m away and 2.5 m wide, hides what is behind
        np.testing.assert_allclose(truck[:, 1], 2.25, atol=1e-3)
        assert np.abs(truck[:, 0]).max() == pytest.approx(6.0, abs=0.1)
        assert truck[:, 2].min() == pytest.approx(0.3 - 1.73, abs=0.2)
        road = points[labels == ROAD]
        assert not ((road[:, 1] > 4.75) & (np.abs(road[:, 0]) < 5.0)
                    & (road[:, 1] < 12.0)).any()


def test_a_convoy_is_six_cars_around(floor):
    points, labels = CLEAN.scan(floor, at(z=1.73), rng(), convoy())
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
