"""The track of the base: pose, covariance and twist of another point of the same rigid body."""
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import InputError
from sgor_ros import TrackedScan
from sgor_ros.core.common import se3
from sgor_ros.io.frames import frame_id
from sgor_ros.io.frames import OdomFrame
from sgor_ros.io.frames import of_base
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.stream_config import StreamConfig

MOUNT = '1.2 -0.3 1.8 0.05 0.1 1.5'


def pose(*numbers):
    return parse_transform(' '.join(map(str, numbers)), 'pose')


def tracked(T, track_id=1, **values):
    fields = dict.fromkeys(TrackedScan.__dataclass_fields__)
    return TrackedScan(**{**fields, 'success': T is not None, 'T_odom_sensor': T,
                          'track_id': track_id, **values})


def perturbed(T, xi):
    """Return T with its origin shifted and turned, as seen from the fixed frame."""
    return se3.compose(Rotation.from_rotvec(xi[3:]).as_matrix() @ T[:3, :3], T[:3, 3] + xi[:3])


def difference(T, T_mean):
    return np.concatenate((T[:3, 3] - T_mean[:3, 3],
                           Rotation.from_matrix(T[:3, :3] @ T_mean[:3, :3].T).as_rotvec()))


def jacobian(function, size=1e-6):
    steps = np.eye(6) * size
    return np.column_stack([(function(x) - function(-x)) / (2 * size) for x in steps])


def test_covariance_is_that_of_moved_noise():
    rng = np.random.default_rng(0)
    mount, T = pose(*map(float, MOUNT.split())), pose(10, 4, 1, 0.1, -0.2, 2)
    root = rng.normal(size=(6, 6))
    covariance = root @ root.T

    def placed(T, start=mount):
        odom = OdomFrame()
        odom.place(tracked(np.eye(4)), start)
        return odom.place(tracked(T, covariance=covariance), mount)

    mean = placed(T)
    J = jacobian(lambda xi: difference(placed(perturbed(T, xi)).T_odom_sensor,
                                       mean.T_odom_sensor))
    np.testing.assert_allclose(mean.covariance, J @ covariance @ J.T, rtol=1e-6, atol=1e-6)


def test_twist_is_that_of_the_moving_base():
    mount, T = pose(*map(float, MOUNT.split())), pose(10, 4, 1, 0.1, -0.2, 2)
    twist = np.array([6.0, 0.4, -0.2, 0.1, -0.3, 0.8])
    root = np.random.default_rng(2).normal(size=(6, 6))
    doubt = root @ root.T
    dt = 1e-6
    moved = T @ se3.compose(Rotation.from_rotvec(twist[3:] * dt).as_matrix(), twist[:3] * dt)
    before = of_base(tracked(T, twist=twist, twist_covariance=doubt), mount)
    after = of_base(tracked(moved), mount).T_odom_sensor
    step = se3.inverse(before.T_odom_sensor) @ after
    seen = np.concatenate((step[:3, 3], Rotation.from_matrix(step[:3, :3]).as_rotvec())) / dt
    np.testing.assert_allclose(before.twist, seen, atol=1e-4)
    J = jacobian(lambda xi: of_base(tracked(T, twist=twist + xi), mount).twist)
    np.testing.assert_allclose(before.twist_covariance, J @ doubt @ J.T, rtol=1e-6, atol=1e-6)


def test_a_base_on_a_circle_begins_at_the_origin():
    """The sensor is mounted askew and off the axis; each track begins anew."""
    mount = pose(*map(float, MOUNT.split()))
    bases = [pose(5 * np.sin(a), 5 - 5 * np.cos(a), 0, 0, 0, a) for a in (0.0, 0.5, 1.0)]
    sensors = [base @ mount for base in bases]
    odom = OdomFrame()
    for first, track_id in ((0, 1), (1, 2), (0, 1)):    # the last goes on with the first
        for base, sensor in zip(bases[first:], sensors[first:], strict=True):
            scan = tracked(se3.inverse(sensors[first]) @ sensor, track_id)
            found = odom.place(scan, mount).T_odom_sensor
            np.testing.assert_allclose(found, se3.inverse(bases[first]) @ base, atol=1e-12)
            np.testing.assert_allclose(odom.of_sensor(scan).T_odom_sensor, found @ mount,
                                       atol=1e-12)


def test_a_mount_that_turns_leaves_the_base_where_it_is():
    """A panning sensor on a standing robot."""
    odom = OdomFrame()
    for angle in (0.0, 0.4, 0.9):
        mount = pose(0.3, 0, 1.0, 0, 0, angle)
        scan = tracked(se3.inverse(pose(0.3, 0, 1.0, 0, 0, 0)) @ mount)
        np.testing.assert_allclose(odom.place(scan, mount).T_odom_sensor, np.eye(4),
                                   atol=1e-12)


@pytest.mark.parametrize('mount', [None, pose(*map(float, MOUNT.split()))])
def test_doubt_about_the_start_goes_with_the_track(mount):
    """A track that begins at a given pose; the one after it begins at the origin."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    start, doubt, T = pose(9, 8, 7, 0.3, 0.2, 1), root @ root.T, pose(10, 4, 1, 0.1, -0.2, 2)

    def at(T_start):
        odom = OdomFrame()
        odom.begin_at(T_start, doubt)
        first = odom.place(tracked(np.eye(4), covariance=np.zeros((6, 6))), mount)
        np.testing.assert_allclose(first.T_odom_sensor, T_start, atol=1e-12)
        np.testing.assert_allclose(first.covariance, doubt)
        return odom, odom.place(tracked(T, covariance=np.zeros((6, 6))), mount)

    odom, mean = at(start)
    J = jacobian(lambda xi: difference(at(perturbed(start, xi))[1].T_odom_sensor,
                                       mean.T_odom_sensor))
    np.testing.assert_allclose(mean.covariance, J @ doubt @ J.T, rtol=1e-5, atol=1e-6)
    again = odom.place(tracked(np.eye(4), 2, covariance=np.zeros((6, 6))), mount)
    np.testing.assert_allclose(again.T_odom_sensor, np.eye(4), atol=1e-12)
    np.testing.assert_array_equal(again.covariance, np.zeros((6, 6)))


def test_without_a_base_or_a_pose_nothing_changes():
    odom = OdomFrame()
    scan = tracked(pose(1, 2, 3, 0, 0, 1), covariance=np.eye(6))
    for same in (odom.of_sensor(scan), odom.place(scan, None),
                 odom.of_sensor(scan)):
        np.testing.assert_allclose(same.T_odom_sensor, scan.T_odom_sensor, atol=1e-15)
        np.testing.assert_allclose(same.covariance, scan.covariance, atol=1e-15)
    lost = replace(scan, T_odom_sensor=None, covariance=None, success=False)
    assert odom.place(lost, np.eye(4)).T_odom_sensor is None


def test_the_numbers_are_those_of_a_urdf():
    """Turns about the fixed axes: roll first, yaw last."""
    T = parse_transform('1, 2,3 0.1 0.2 0.3', 'it')
    R = (Rotation.from_euler('z', 0.3) * Rotation.from_euler('y', 0.2)
         * Rotation.from_euler('x', 0.1))
    np.testing.assert_allclose(T, se3.compose(R.as_matrix(), np.array([1.0, 2, 3])), atol=1e-12)


@pytest.mark.parametrize('text', [
    '1 2 3', 'a b c d e f', '1 2 3 4 5 nan', '1 2 3 4 5 6 7', ' '])
def test_what_is_no_transformation_is_named(text):
    with pytest.raises(InputError, match=r'T_base_sensor = .*expected six numbers'):
        StreamConfig(base_frame='base_link', T_base_sensor=text)


def test_an_extrinsic_needs_a_base():
    with pytest.raises(InputError, match='base_frame'):
        StreamConfig(T_base_sensor=MOUNT)


def test_frame_ids_have_no_leading_slash():
    assert frame_id('/velodyne') == frame_id('velodyne') == 'velodyne'
    with pytest.raises(InputError, match="base_frame = '/base_link'"):
        StreamConfig(base_frame='/base_link')
