"""What a sensor sees of what it would see if it were turned."""
import numpy as np
import pytest

from sgor_ros.core.common import se3
from sgor_ros.core.index.range_image import range_image
from sgor_ros.core.index.range_image import view_overlap
from sgor_ros.core.scan.directions import by_direction


def ranges_of(azimuths_deg, elevations_deg):
    """Return the range image of a sensor with returns from 10 m, a degree apart."""
    azimuth, elevation = (np.radians(one).ravel() for one in np.meshgrid(
        np.arange(*azimuths_deg), np.arange(*elevations_deg)))
    points = 10 * np.column_stack((np.cos(elevation) * np.cos(azimuth),
                                   np.cos(elevation) * np.sin(azimuth), np.sin(elevation)))
    rays = by_direction(points.astype(np.float32))
    return range_image(rays, np.ones(len(points), np.bool_))


def turned(axis, degrees):
    return se3.rotations(np.radians(degrees) * np.eye(3)[axis])


@pytest.mark.parametrize('yaw_deg', [0, 20, 45, 90, 180])
def test_a_sensor_that_spins_sees_the_same_whatever_its_yaw(yaw_deg):
    assert view_overlap(ranges_of((-180, 180), (-15, 15, 2)), turned(2, yaw_deg)) == 1


@pytest.mark.parametrize(('yaw_deg', 'expected'), [
    (0, 1), (15, 5 / 6), (45, 1 / 2), (60, 1 / 3), (90, 0), (180, 0), (-45, 1 / 2)])
def test_a_view_of_90_degrees_shares_what_is_left_of_it(yaw_deg, expected):
    ranges = ranges_of((-44, 45), (-14, 15))
    assert view_overlap(ranges, turned(2, yaw_deg)) == pytest.approx(expected, abs=0.01)


def test_no_axis_is_special():
    """A spinning sensor that is mounted on its side, tilted about the axis that it spins about."""
    upright = ranges_of((-180, 180), (-30, 30))
    assert view_overlap(upright, turned(0, 90)) == pytest.approx(view_overlap(
        upright, turned(1, 90)), abs=0.05)
    assert view_overlap(upright, turned(0, 90)) < 0.5
