"""Sensors that are sold, before surfaces at known places."""
from dataclasses import replace

import boxes
from boxes import angles
from boxes import at
from boxes import clean
from boxes import FENCE
from boxes import rng
from boxes import ROAD
from boxes import scene
import numpy as np
import pytest
from scipy.spatial import cKDTree

from sgor_ros.world import Lidar
from sgor_ros.world.sensors import SENSORS

SPINNING = [name for name, sensor in SENSORS.items() if type(sensor) is Lidar]


def test_each_beam_of_a_vlp_16_meets_level_ground_at_its_range():
    points, labels = clean(SENSORS['VLP-16']).scan(boxes.floor(), at(z=2.0), rng())
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
def test_beams_are_where_the_manual_says(name, degrees):
    points, _ = clean(SENSORS[name]).scan(boxes.room(), np.eye(4), rng())
    _, elevation = angles(points.reshape(len(degrees), -1, 3)[:, 0])
    np.testing.assert_allclose(elevation, degrees, atol=0.01)


def test_beams_of_a_pandar64_are_dense_at_the_horizon_and_sparse_below():
    points, _ = clean(SENSORS['Pandar64']).scan(boxes.room(), np.eye(4), rng())
    _, elevation = angles(points.reshape(64, 1800, 3)[:, 0])
    gap = -np.diff(elevation)
    np.testing.assert_allclose(gap[(elevation[1:] < 2) & (elevation[1:] > -6)], 1 / 6, atol=0.01)
    assert gap[-1] == pytest.approx(6.008, abs=1e-3)
    assert elevation[0] - elevation[-1] == pytest.approx(39.779, abs=1e-3)


@pytest.mark.parametrize('name', SENSORS)
def test_a_sensor_fills_its_field_of_view_and_no_more(name):
    sensor = clean(SENSORS[name])
    points, _ = sensor.scan(boxes.room(), np.eye(4), rng())
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
def test_noise_is_that_of_the_sheet_and_the_seed_decides(name):
    sensor = replace(SENSORS[name], drop_out=0.0, min_range=0.0)
    points, _ = sensor.scan(boxes.room(), np.eye(4), rng(3))
    np.testing.assert_array_equal(points, sensor.scan(boxes.room(), np.eye(4), rng(3))[0])
    truth, _ = replace(sensor, range_noise=0.0).scan(boxes.room(), np.eye(4), rng(3))
    error = np.linalg.norm(points, axis=1) - np.linalg.norm(truth, axis=1)
    assert error.std() == pytest.approx(sensor.range_noise, rel=0.05)


@pytest.mark.parametrize('name', ['Avia', 'Mid-360'])
def test_a_livox_looks_elsewhere_in_each_scan(name):
    """Ten scans fill gaps that one leaves; ten turns of a spinning one hit the same rings."""
    source, sensor = rng(), clean(SENSORS[name])
    scans = [sensor.scan(boxes.room(), np.eye(4), source)[0] for _ in range(10)]
    units = [p / np.linalg.norm(p, axis=1, keepdims=True) for p in scans]
    places = np.concatenate(units)[rng(1).integers(10 * len(units[0]), size=2000)]
    one = np.quantile(cKDTree(units[0]).query(places)[0], 0.9)
    ten = np.quantile(cKDTree(np.concatenate(units[1:])).query(
        units[0][::10])[0], 0.9)
    assert ten < 0.6 * one
    *_, times = sensor.sweep(boxes.room(), np.eye(4), source, np.zeros(6))
    assert (np.diff(times.reshape(sensor.beams, -1), axis=1) > 0).all()
    assert times.max() < 0.1
