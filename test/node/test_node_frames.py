"""Frames of what the node publishes, over real DDS: base, sensor, transforms, relative poses."""
import ctypes
from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys

from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
import ros_helpers as ros
from ros_helpers import street

from sgor_ros.core.common import se3
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.messages import matrix_of
from sgor_ros.io.messages import matrix_of_transform
from sgor_ros.io.messages import transform_stamped
from sgor_ros.ros.playback.node_process import NodeProcess
from sgor_ros.ros.types import ros_type

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
# where scripts/tf2_msgs.sh puts it
TF2_MSGS = Path(os.environ.get('SGOR_TF2_MSGS', f'{sys.prefix}/tf2_msgs'))
# asked while tests are collected, before one of them brings its own along
INSTALLED = {name: find_spec(name) is not None for name in ('tf2_msgs', 'tf2_ros')}
OK, WARN = b'\x00', b'\x01'
MOUNT = '1.2 -0.3 1.8 0.05 0.1 1.5'
T_BASE_SENSOR = parse_transform(MOUNT, 'mount')


@pytest.fixture(scope='module')
def scans():
    return street(4)


@pytest.fixture
def tf2_msgs(monkeypatch):
    """Let this process and its children import tf2_msgs: the real one or that of the tests."""
    if not INSTALLED['tf2_msgs']:
        libraries = sorted((TF2_MSGS / 'lib').glob('*.so'))
        if not libraries:
            pytest.skip(f'no tf2_msgs: scripts/tf2_msgs.sh PYTHON {TF2_MSGS}')
        site = TF2_MSGS / f'lib/python3.{sys.version_info.minor}/site-packages'
        monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
            filter(None, (str(site), os.environ.get('PYTHONPATH')))))
        monkeypatch.setenv('LD_LIBRARY_PATH', os.pathsep.join(
            filter(None, (f'{TF2_MSGS}/lib', os.environ.get('LD_LIBRARY_PATH')))))
        monkeypatch.syspath_prepend(str(site))
        # the loader of this process has read its path already
        waiting = libraries
        while waiting:
            waiting = [library for library in waiting if not loaded(library)]
    return ros_type('tf2_msgs/msg/TFMessage')


def loaded(library):
    try:
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    except OSError:
        return False
    return True


def expected(scans, index):
    """Return the pose of the base when it begins at the origin."""
    base = [pose @ se3.inverse(T_BASE_SENSOR) for *_, pose in scans]
    return np.linalg.inv(base[0]) @ base[index]


def assert_near(T, truth):
    metres, radians = ros.difference(T, truth)
    assert metres < 0.15
    assert radians < 0.02


def play(partner, node, scans):
    partner.wait_for_node(node.alive)
    return [partner.outcome(ros.cloud(points, labels, stamp, '/lidar'))
            for stamp, points, labels, _ in scans]


def start(domain, tmp_path, *parameters):
    arguments = [word for item in parameters for word in ('-p', item)]
    return NodeProcess(domain, tmp_path / 'log', *arguments)


def test_odometry_of_the_base(domain, scans, tmp_path):
    with start(domain, tmp_path, 'base_frame:=base_link', f'T_base_sensor:={MOUNT}') as node, \
            ros.Partner(domain) as partner:
        for level, message, _ in play(partner, node, scans):
            assert level == OK, message
        partner.spin_until(lambda: len(partner.odometry) == len(partner.poses) == len(scans))
        for index, (odometry, pose) in enumerate(
                zip(partner.odometry, partner.poses, strict=True)):
            assert odometry.header.frame_id == pose.header.frame_id == 'odom'
            assert odometry.child_frame_id == 'base_link'
            assert odometry.pose.pose == pose.pose
            assert_near(matrix_of(odometry.pose.pose), expected(scans, index))
        # 6 m/s along the sensor's x, which points to the left of the base
        ahead = odometry.twist.twist.linear
        assert [ahead.x, ahead.y, ahead.z] == pytest.approx([0.4, 5.9, -0.6], abs=1.5)
        assert node.stop() == 0


@pytest.mark.parametrize('inverted', [False, True])
def test_the_transform_says_what_the_odometry_says(domain, scans, tmp_path, tf2_msgs, inverted):
    with start(domain, tmp_path, 'base_frame:=base_link', f'T_base_sensor:={MOUNT}',
               'publish_tf:=true', f'invert_tf:={str(inverted).lower()}') as node, \
            ros.Partner(domain) as partner:
        heard = partner.hear(tf2_msgs, '/tf')
        play(partner, node, scans)
        partner.spin_until(lambda: len(heard) == len(partner.odometry) == len(scans))
        for message, odometry in zip(heard, partner.odometry, strict=True):
            one, = message.transforms
            assert one.header.stamp == odometry.header.stamp
            frames = [one.header.frame_id, one.child_frame_id]
            assert frames == (['base_link', 'odom'] if inverted else ['odom', 'base_link'])
            T = matrix_of_transform(one.transform)
            np.testing.assert_allclose(se3.inverse(T) if inverted else T,
                                       matrix_of(odometry.pose.pose), atol=1e-9)
        assert node.stop() == 0


def test_without_a_transform_to_the_base_nothing_is_published(domain, scans, tmp_path, tf2_msgs,
                                                              monkeypatch):
    """It comes late: said once, counted, never taken for the identity; then it goes on."""
    if not INSTALLED['tf2_ros']:
        monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
            (str(HERE / 'tf2_stand_in'), os.environ.get('PYTHONPATH', ''))))
    with start(domain, tmp_path, 'base_frame:=base_link') as node, \
            ros.Partner(domain) as partner:
        told = play(partner, node, scans[:2])
        assert [level for level, *_ in told] == [WARN, WARN]
        assert 'nothing is published: no transform from lidar to base_link' in told[0][1]
        assert told[1][2]['processed'] == '2'
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        partner.node.create_publisher(tf2_msgs, '/tf_static', latched).publish(tf2_msgs(
            transforms=[transform_stamped(ros_type, T_BASE_SENSOR, 0, 'base_link', 'lidar')]))
        partner.spin_for(1.0)
        assert not partner.odometry
        assert not partner.poses
        for level, message, _ in play(partner, node, scans[2:]):
            assert level == OK, message
        partner.spin_until(lambda: len(partner.odometry) == 2)
        for index, odometry in enumerate(partner.odometry, 2):
            assert_near(matrix_of(odometry.pose.pose), expected(scans, index))
        assert node.stop() == 0
    assert node.log.read_text().count('no transform from lidar to base_link') == 1


def test_a_stamp_that_tf2_refuses_fails_one_scan(domain, scans, tmp_path, tf2_msgs, monkeypatch):
    """Before 1970, say, where a driver subtracts its offset from a clock that was not set."""
    if not INSTALLED['tf2_ros']:
        monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
            (str(HERE / 'tf2_stand_in'), os.environ.get('PYTHONPATH', ''))))
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    with start(domain, tmp_path, 'base_frame:=base_link') as node, \
            ros.Partner(domain) as partner:
        partner.node.create_publisher(tf2_msgs, '/tf_static', latched).publish(tf2_msgs(
            transforms=[transform_stamped(ros_type, T_BASE_SENSOR, 0, 'base_link', 'lidar')]))
        partner.wait_for_node(node.alive)
        partner.spin_for(1.0)
        early = (-5_000_000_000, *scans[0][1:])
        (level, message, _), = play(partner, node, [early])
        assert level == WARN
        assert 'no transform from lidar to base_link' in message
        (level, message, values), = play(partner, node, [scans[1]])
        assert (level, values['processed']) == (OK, '2'), message
        partner.spin_until(lambda: partner.odometry)
        assert node.stop() == 0


@pytest.mark.skipif(INSTALLED['tf2_ros'], reason='tf2_ros is installed')
def test_a_base_that_nothing_leads_to_is_refused(domain):
    ran = subprocess.run([sys.executable, '-m', 'sgor_ros.ros.main', '--ros-args', '-p',
                          'base_frame:=base_link'], env=domain.environment(), cwd=ROOT,
                         capture_output=True, text=True, timeout=60)
    assert ran.returncode == 2
    assert ran.stderr.startswith("error: base_frame = 'base_link'")
    assert 'T_base_sensor' in ran.stderr
    assert 'tf2_ros' in ran.stderr


def test_relative_poses_name_both_scans_and_have_their_own_covariance(domain, scans, tmp_path):
    """Between sensors, whatever the odometry is of, and the frames have no leading slash."""
    with start(domain, tmp_path, 'base_frame:=base_link', f'T_base_sensor:={MOUNT}') as node, \
            ros.Partner(domain) as partner:
        edges = partner.hear(Odometry, '/relative_pose')
        play(partner, node, scans)
        partner.spin_until(lambda: len(edges) == len(scans) - 1)
        truth = {stamp: pose for stamp, *_, pose in scans}
        for edge, (stamp, *_) in zip(edges, scans[1:], strict=True):
            assert ros.stamp_ns_of(edge.header) == stamp
            names = [name.rpartition('@') for name in (edge.child_frame_id, edge.header.frame_id)]
            assert [name for name, *_ in names] == ['lidar', 'lidar']
            source, target = (int(stamp_ns) for *_, stamp_ns in names)
            assert source == stamp
            assert_near(matrix_of(edge.pose.pose), np.linalg.inv(truth[target]) @ truth[source])
            covariance = edge.pose.covariance.reshape(6, 6)
            np.testing.assert_allclose(covariance, covariance.T)
            assert (np.linalg.eigvalsh(covariance) > 0).all()
        assert node.stop() == 0
