"""Times of points, in every form that drivers have for them."""
import numpy as np
import pytest

from sgor_ros.core.common.settings import InputError
from sgor_ros.io.bags import BagWriter
from sgor_ros.io.messages import point_cloud2
from sgor_ros.io.pointcloud2 import decode
from sgor_ros.io.sequence import scan_of_cloud
from sgor_ros.io.time_field import seconds_since

STAMP_NS = 1_700_000_000_123_456_789
TIMES = np.linspace(0, 0.0999, 400)
FORMATS = {'u4': 6, 'f4': 7, 'f8': 8, 'i4': 5}
# form of a driver -> field, type, what it holds, what that is since the stamp
FORMS = {
    'Ouster': ('t', 'u4', TIMES * 1e9, TIMES),
    'Velodyne, stamp at the start': ('time', 'f4', TIMES, TIMES),
    'Velodyne, stamp at the end': ('time', 'f4', TIMES - 0.0999, TIMES - 0.0999),
    'Hesai': ('timestamp', 'f8', STAMP_NS * 1e-9 + TIMES, TIMES),
    'Livox': ('timestamp', 'f8', STAMP_NS + TIMES * 1e9, TIMES),
    'Livox message': ('offset_time', 'u4', TIMES * 1e9, TIMES),
    'microseconds': ('t', 'f4', TIMES * 1e6, TIMES),
    'milliseconds': ('time', 'f4', TIMES * 1e3, TIMES),
    'another clock': ('timestamp', 'f8', 5000 + TIMES, TIMES),
    'stamp at the end, absolute': ('time_stamp', 'f8', STAMP_NS * 1e-9 - TIMES, -TIMES)}


def cloud_with(tmp_path, field, kind, values):
    """Return a PointCloud2 of rosbags with points along x and one more field."""
    types = BagWriter(tmp_path / 'never written').types
    points = np.stack((np.arange(1.0, len(values) + 1), values * 0, values * 0), axis=1)
    message = point_cloud2(types, points, None, STAMP_NS, 'lidar')
    records = np.empty(len(values), np.dtype([('xyz', '<f4', 3), ('time', '<' + kind)]))
    records['xyz'], records['time'] = points, values
    message.fields.append(types('sensor_msgs/msg/PointField')(field, 12, FORMATS[kind], 1))
    message.point_step = records.itemsize
    message.row_step = records.nbytes
    message.data = np.frombuffer(records.tobytes(), np.uint8)
    return message


@pytest.mark.parametrize('form', FORMS)
def test_the_times_of_a_driver(tmp_path, form):
    field, kind, values, expected = FORMS[form]
    message = cloud_with(tmp_path, field, kind, values)
    scan = scan_of_cloud(message, 'none', 0).read()
    np.testing.assert_allclose(scan.times, expected, atol=2e-5)
    np.testing.assert_allclose(scan.points[:, 0], np.arange(1, 401))
    assert scan_of_cloud(message, 'none', 0, 'none').read().times is None


def test_a_field_by_its_name_and_one_that_is_not_there(tmp_path):
    message = cloud_with(tmp_path, 'stamp_of_point', 'f4', TIMES)
    assert scan_of_cloud(message, 'none', 0).read().times is None
    named = scan_of_cloud(message, 'none', 0, 'stamp_of_point').read()
    np.testing.assert_allclose(named.times, TIMES, atol=1e-6)
    with pytest.raises(InputError, match='field when: the cloud has none'):
        decode(message, '', 'when')
    with pytest.raises(InputError, match='field x: it holds coordinates, not times'):
        decode(message, '', 'x')


@pytest.mark.parametrize(('values', 'says'), [
    (np.array([0, 3e9]), r'field t: from 0.0 to 3000000000.0, no sweep takes that long'),
    (np.array([np.nan, np.inf]), 'field t: no time is finite')])
def test_what_are_no_times(values, says):
    with pytest.raises(InputError, match=says):
        seconds_since(0, values, 't')


def test_what_nobody_has_named_and_is_no_time_costs_no_scan(tmp_path):
    message = cloud_with(tmp_path, 't', 'f8', np.array([0, 5e9, 7e9]))
    assert scan_of_cloud(message, 'none', 0).read().times is None
    with pytest.raises(InputError, match=r'field t: from 0\.0 to 7000000000\.0'):
        scan_of_cloud(message, 'none', 0, 't').read()
    message.fields[-1].count = 3
    assert scan_of_cloud(message, 'none', 0).read().times is None


def test_one_time_for_all_is_none():
    assert seconds_since(STAMP_NS, np.full(5, 17, np.uint32), 't') is None


def test_a_time_that_is_not_finite_costs_no_point():
    times = seconds_since(0, np.array([0, 0.05, np.nan, 0.1]), 't')
    np.testing.assert_allclose(times, [0, 0.05, 0, 0.1])


def test_nanoseconds_of_whole_numbers_keep_all_their_digits():
    values = np.int64(STAMP_NS) + np.arange(0, 100_000_000, 1_000_003)
    np.testing.assert_allclose(seconds_since(STAMP_NS, values, 't') * 1e9,
                               np.arange(0, 100_000_000, 1_000_003), atol=1e-6)
