"""Clouds as drivers send them: any layout gives the same scan, nonsense gives a clear error."""
import importlib
from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from sgor_ros import InputError
from sgor_ros import Registration
from sgor_ros import Status
from sgor_ros import TrackedScan
from sgor_ros.io import messages
from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.label_field import choice_in_words
from sgor_ros.io.label_field import label_field_of
from sgor_ros.io.pointcloud2 import decode

CODES = {'i1': 1, 'u1': 2, 'i2': 3, 'u2': 4, 'i4': 5, 'u4': 6, 'f4': 7, 'f8': 8}
STORE = get_typestore(Stores.ROS2_JAZZY)


def bag_type(name):
    return STORE.types[name]


def ros_type(name):
    package, _, message = name.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), message)


def scan(count=24, largest=100):
    rng = np.random.default_rng(0)
    return rng.normal(0, 30, (count, 3)).astype(np.float32), rng.integers(0, largest, count)


def cloud(points, labels, columns, padding=0, rows=1, row_padding=0, big=False):
    """Lay out a cloud by hand; `columns` are (name, numpy code) in their order."""
    order = '>' if big else '<'
    record = np.dtype([(name, order + code) for name, code in columns]
                      + [('padding', f'V{padding}')] * bool(padding))
    values = np.zeros(len(points), record)
    for name, source in zip('xyz', points.T, strict=True):
        values[name] = source
    for name in {'label', 'class_id', 'ObjTag'}.intersection(record.names):
        values[name] = labels
    width = len(points) // rows
    lines = [values[i * width:(i + 1) * width].tobytes() + b'\xee' * row_padding
             for i in range(rows)]
    fields = [SimpleNamespace(name=name, offset=record.fields[name][1], datatype=CODES[code],
                              count=1) for name, code in columns]
    return SimpleNamespace(
        fields=fields, height=rows, width=width, point_step=record.itemsize,
        row_step=width * record.itemsize + row_padding, is_bigendian=big,
        data=np.frombuffer(b''.join(lines), np.uint8))


XYZ = [('x', 'f4'), ('y', 'f4'), ('z', 'f4')]


@pytest.mark.parametrize('label_code', CODES)
@pytest.mark.parametrize('big', [False, True])
def test_label_types_and_byte_orders(label_code, big):
    points, labels = scan()
    message = cloud(points, labels, [*XYZ, ('label', label_code)], big=big)
    result = decode(message, 'label')
    np.testing.assert_array_equal(result.points, points)
    np.testing.assert_array_equal(result.labels, labels)


@pytest.mark.parametrize('layout', [
    {'columns': [('label', 'u2'), ('z', 'f4'), ('intensity', 'f4'), ('x', 'f4'), ('y', 'f4')]},
    {'columns': [('x', 'f8'), ('y', 'f8'), ('z', 'f8'), ('label', 'u4')]},
    {'columns': [*XYZ, ('label', 'u1')], 'padding': 19},
    {'columns': [*XYZ, ('label', 'u1')], 'rows': 4, 'row_padding': 7},
    {'columns': [*XYZ, ('label', 'u1')], 'rows': 3, 'padding': 3, 'row_padding': 5, 'big': True},
], ids=['order', 'double', 'padding', 'organised', 'all'])
def test_layouts(layout):
    points, labels = scan()
    result = decode(cloud(points, labels, **layout), 'label')
    np.testing.assert_array_equal(result.points, points)
    np.testing.assert_array_equal(result.labels, labels)


def test_the_packed_points_of_autoware_ptv3():
    """21 bytes a point, so nearly no number of them is aligned."""
    points, labels = scan(1001)
    message = cloud(points, labels, [*XYZ, ('class_id', 'u1'), ('probability', 'f4'),
                                     ('entropy', 'f4')])
    assert message.point_step == 21
    result = decode(message, label_field_of(message, 'auto'))
    np.testing.assert_array_equal(result.points, points)
    np.testing.assert_array_equal(result.labels, labels)


@pytest.mark.parametrize(('names', 'wanted', 'chosen'), [
    (['label'], 'auto', 'label'), (['class_id'], 'auto', 'class_id'),
    (['ObjIdx', 'ObjTag'], 'auto', 'ObjTag'), (['class_id', 'label'], 'auto', 'label'),
    (['class_id', 'label'], 'class_id', 'class_id'), (['label'], 'mine', 'mine'),
    (['intensity'], 'auto', ''), (['label'], 'none', ''), (['label'], '', '')])
def test_which_field_is_read(names, wanted, chosen):
    message = SimpleNamespace(fields=[SimpleNamespace(name=name) for name in names])
    assert label_field_of(message, wanted) == chosen
    words = choice_in_words(message, wanted)
    assert bool(words) == (wanted == 'auto')
    if words:
        assert (chosen or 'without labels: none of') in words
        assert chosen or 'is among intensity' in words


@pytest.mark.parametrize('name', ['x', 'y', 'z'])
def test_coordinates_are_no_class_ids(name):
    with pytest.raises(InputError, match=f'field {name}: it holds coordinates'):
        decode(cloud(*scan(), [*XYZ, ('label', 'f4')]), name)


def test_large_ids_keep_their_instance_bits():
    points, _ = scan(3)
    labels = np.array([0xFFFF000A, 10, 252])
    result = decode(cloud(points, labels, [*XYZ, ('label', 'u4')]), 'label')
    assert result.labels.tolist() == labels.tolist()


def test_nan_points_go_with_their_labels():
    points, labels = scan()
    points[[2, 5]], points[7, 1] = np.nan, np.inf
    floats = labels.astype(np.float32)
    floats[2] = np.nan    # a label that nobody needs
    result = decode(cloud(points, floats, [*XYZ, ('label', 'f4')]), 'label')
    keep = np.isfinite(points).all(axis=1)
    np.testing.assert_array_equal(result.points, points[keep])
    np.testing.assert_array_equal(result.labels, labels[keep])


def test_empty_label_field_means_no_labels():
    points, labels = scan()
    assert decode(cloud(points, labels, [*XYZ, ('label', 'u4')]), '').labels is None


def spoilt(**changes):
    message = cloud(*scan(), [*XYZ, ('label', 'f4')])
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def spoilt_field(name, /, **changes):
    message = spoilt()
    field = next(f for f in message.fields if f.name == name)
    for key, value in changes.items():
        setattr(field, key, value)
    return message


@pytest.mark.parametrize(('message', 'field', 'says'), [
    (spoilt(), 'semantic', 'field semantic: .* x, y, z, label'),
    (spoilt(fields=[]), 'label', 'field x: .* none at all'),
    (spoilt_field('y', name='why'), 'label', 'field y: .* x, why, z, label'),
    (spoilt_field('z', name='y'), 'label', 'field y: the cloud has 2; .* x, y, y, label'),
    (cloud(scan()[0], 1e300, [*XYZ, ('label', 'f8')]), 'label', r'field label: 1e\+300 at'),
    (cloud(scan()[0], np.inf, [*XYZ, ('label', 'f4')]), 'label', 'field label: inf at point 0'),
    (spoilt(width=0), 'label', '0 x 1: the cloud is empty'),
    (spoilt(data=np.zeros(100, np.uint8)), 'label', '100 bytes, .* need 384'),
    (spoilt(height=2, row_step=10), 'label', 'row_step = 10'),
    (spoilt(point_step=14), 'label', 'field label: .* beyond point_step = 14'),
    (spoilt_field('label', datatype=9), 'label', 'field label: unsupported datatype 9'),
    (spoilt_field('x', datatype=CODES['i4']), 'label', 'field x: unsupported datatype 5'),
    (spoilt_field('label', count=3), 'label', 'field label: count = 3'),
    (cloud(scan()[0], 0.5, [*XYZ, ('label', 'f4')]), 'label', 'field label: 0.5 at point 0'),
    (cloud(scan()[0] * np.nan, 0, [*XYZ, ('label', 'u4')]), 'label', 'none of 24 is finite'),
])
def test_unusable_clouds_are_named(message, field, says):
    with pytest.raises(InputError, match=says):
        decode(message, field)


def tracked(**changes):
    points, _ = scan(50)
    T_odom_sensor, step = pose(0.3, (4.0, -2.0, 1.0)), pose(0.1, (1.0, 0.5, 0.0))
    moved = points @ step[:3, :3].T + step[:3, 3]
    inliers = np.arange(50) < 10
    result = Registration(Status.REGISTERED, '', step, points.astype(float),
                          np.where(inliers[:, None], moved, moved + 9.0), inliers)
    values = {
        'stamp_ns': 1_700_000_000_123_456_789, 'success': True, 'reason': '',
        'T_odom_sensor': T_odom_sensor, 'covariance': np.arange(36.0).reshape(6, 6),
        'twist': np.arange(6.0), 'registration': result, 'reference_stamp_ns': 5,
        'keyframe': True, 'restarted': False, 'warnings': (), 'timings': {},
        'twist_covariance': np.arange(36.0).reshape(6, 6) + 1, 'T_reference_sensor': step,
        'reference_covariance': np.arange(36.0).reshape(6, 6) + 2}
    return TrackedScan(**{**values, **changes})


def pose(yaw, xyz):
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T[:3, 3] = xyz
    return T


def test_odometry_has_pose_covariance_and_twist_where_ros_has_them():
    message = messages.odometry(bag_type, tracked(), 'odom', 'lidar')
    assert (message.header.frame_id, message.child_frame_id) == ('odom', 'lidar')
    assert stamp_ns_of(message.header) == 1_700_000_000_123_456_789
    position, turn = message.pose.pose.position, message.pose.pose.orientation
    assert (position.x, position.y, position.z) == pytest.approx((4.0, -2.0, 1.0))
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((0, 0, np.sin(0.15), np.cos(0.15)))
    np.testing.assert_array_equal(message.pose.covariance, np.arange(36.0))
    assert message.twist.twist.linear.y == 1.0
    assert message.twist.twist.angular.z == 5.0
    np.testing.assert_array_equal(message.twist.covariance, np.arange(36.0) + 1)


def test_a_relative_pose_names_both_scans():
    message = messages.relative_pose(bag_type, tracked(), 'lidar')
    assert stamp_ns_of(message.header) == 1_700_000_000_123_456_789
    assert message.header.frame_id == 'lidar@5'
    assert message.child_frame_id == 'lidar@1700000000123456789'
    np.testing.assert_allclose(messages.matrix_of(message.pose.pose),
                               pose(0.1, (1.0, 0.5, 0.0)), atol=1e-12)
    np.testing.assert_array_equal(message.pose.covariance, np.arange(36.0) + 2)
    assert message.twist.covariance[0] > 1e5


def test_what_is_unknown_weighs_nothing_in_any_axis():
    message = messages.odometry(
        bag_type, tracked(covariance=None, twist_covariance=None), 'odom', 'lidar')
    for part in (message.pose, message.twist):
        # a filter inverts it: no axis may be exact, none may be negative
        information = np.linalg.inv(part.covariance.reshape(6, 6))
        assert (np.linalg.eigvalsh(information) > 0).all()
        assert np.abs(information).max() < 1e-5


def test_lines_of_inliers_have_no_length_in_the_odom_frame():
    inliers, rejected = messages.correspondence_markers(bag_type, tracked(), 'odom').markers
    assert (inliers.ns, rejected.ns) == ('inliers', 'rejected')
    assert (len(inliers.points), len(rejected.points)) == (20, 80)
    np.testing.assert_allclose(lengths(inliers), 0.0, atol=1e-5)
    np.testing.assert_allclose(lengths(rejected), 9.0 * np.sqrt(3), atol=1e-5)
    first = inliers.points[0]
    expected = (pose(0.3, (4.0, -2.0, 1.0)) @ [*scan(50)[0][0], 1.0])[:3]
    assert (first.x, first.y, first.z) == pytest.approx(expected, abs=1e-5)


def lengths(marker):
    ends = np.array([[p.x, p.y, p.z] for p in marker.points]).reshape(-1, 2, 3)
    return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)


def test_a_scan_without_a_pose_clears_the_lines():
    lost = tracked(success=False, T_odom_sensor=None)
    markers = messages.correspondence_markers(bag_type, lost, 'odom').markers
    assert [marker.action for marker in markers] == [messages.DELETE_ALL]


@pytest.mark.parametrize('build', [
    lambda types: messages.point_cloud2(types, *scan(), 7, 'lidar'),
    lambda types: messages.odometry(types, tracked(), 'odom', 'lidar'),
    lambda types: messages.pose_stamped(types, tracked(), 'odom'),
    lambda types: messages.correspondence_markers(types, tracked(), 'odom'),
], ids=['cloud', 'odometry', 'pose', 'markers'])
def test_rclpy_reads_what_rosbags_wrote(build):
    serialization = pytest.importorskip('rclpy.serialization')
    ours, theirs = build(bag_type), build(ros_type)
    raw = bytes(STORE.serialize_cdr(ours, ours.__msgtype__))
    # through the wire once, so that float32 fields are rounded on both sides
    expected = serialization.deserialize_message(
        serialization.serialize_message(theirs), type(theirs))
    assert serialization.deserialize_message(raw, type(theirs)) == expected


def test_rclpy_clouds_are_decoded():
    pytest.importorskip('rclpy')
    points, labels = scan()
    result = decode(messages.point_cloud2(ros_type, points, labels, 7, 'lidar'), 'label')
    np.testing.assert_array_equal(result.points, points)
    np.testing.assert_array_equal(result.labels, labels)
