"""What the node says without being asked, and what it can be told, over real DDS."""
import subprocess
import sys

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.qos import ReliabilityPolicy
import ros_helpers as ros
from ros_helpers import status
from ros_helpers import street
from std_srvs.srv import Trigger

from sgor_ros.io.frames import parse_transform
from sgor_ros.io.messages import matrix_of
from sgor_ros.io.messages import pose
from sgor_ros.ros.input.stamp_gaps import StampGaps
from sgor_ros.ros.playback.node_process import NodeProcess
from sgor_ros.ros.types import ros_type

OK, WARN, ERROR, STALE = b'\x00', b'\x01', b'\x02', b'\x03'
PERIOD_NS = 100_000_000
MOUNT = '1.2 -0.3 1.8 0.05 0.1 1.5'


@pytest.fixture(scope='module')
def scans():
    return street(6)


@pytest.fixture
def pair(domain, tmp_path):
    """Return a function that starts a node, and a partner when it is ready."""
    started = []

    def start(*parameters):
        arguments = [word for item in parameters for word in ('-p', item)]
        node = NodeProcess(domain, tmp_path / 'log', *arguments)
        started.append(node)
        partner = ros.Partner(domain)
        started.append(partner)
        partner.wait_for_node(node.alive)
        return node, partner

    yield start
    for one in reversed(started):
        one.__exit__(None, None, None)


def cloud_of(scan, frame='lidar'):
    stamp, points, labels, _ = scan
    return ros.cloud(points, labels, stamp, frame)


def assert_near(T, truth):
    metres, radians = ros.difference(T, truth)
    assert metres < 0.15
    assert radians < 0.02


def test_it_speaks_at_a_steady_rate_when_no_clouds_come(pair, scans):
    node, partner = pair()
    partner.diagnostics.clear()
    partner.spin_until(lambda: len(partner.diagnostics) >= 2, what='diagnostics')
    for message in partner.diagnostics:
        level, words, values = status(message)
        assert (level, words) == (WARN, 'no clouds yet')
        assert values['received'] == '0'
    assert partner.outcome(cloud_of(scans[0]))[0] == OK
    partner.diagnostics.clear()
    partner.spin_until(lambda: len(partner.diagnostics) >= 2, what='diagnostics')
    level, words, values = status(partner.diagnostics[-1])
    assert level == STALE
    assert words.startswith('no clouds for ')
    assert (values['received'], values['processed']) == ('1', '1')
    assert node.stop() == 0


def test_scans_that_never_came_are_counted_by_their_stamps(pair, scans):
    node, partner = pair()
    _, points, labels, _ = scans[0]
    for step in (0, 1, 2, 3, 4, 5, 6, 8, 9, 12, 13):
        values = partner.outcome(ros.cloud(points, labels, ros.START_NS + step * PERIOD_NS))[2]
    assert (values['received'], values['missed']) == ('11', '3')
    assert node.stop() == 0
    assert node.log.read_text().splitlines()[-1].endswith('missed 3')


@pytest.mark.parametrize(('steps', 'missed'), [
    ([1] * 10, 0), ([1, 1.3, 0.7, 1, 1.2, 0.9] * 3, 0), ([1] * 6 + [2, 1, 4], 4),
    ([1] * 6 + [600, 1], 0), ([1] * 6 + [-3, 1, 1, 2], 1), ([1, 5, 1, 1], 0),
    # from 10 to 5 Hz: some are taken for lost until the new rate is known
    ([1] * 20 + [2] * 60, 10)])
def test_gaps_between_stamps(steps, missed):
    gaps = StampGaps()
    for stamp in np.cumsum([0, *steps]) * PERIOD_NS:
        gaps.take(int(stamp))
    assert gaps.missed == missed


def test_a_pause_leaves_clouds_out_and_the_track_goes_on(pair, scans):
    node, partner = pair()
    assert partner.outcome(cloud_of(scans[0]))[0] == OK
    assert partner.call(Trigger, '/pause', Trigger.Request()).success
    for scan in scans[1:4]:
        partner.send(scan[0], cloud_of(scan))
    partner.spin_until(lambda: any(
        status(message)[2]['paused'] == '3' for message in partner.diagnostics))
    assert status(partner.diagnostics[-1])[1] == 'paused: clouds are left out'
    assert partner.call(Trigger, '/resume', Trigger.Request()).success
    level, _, values = partner.outcome(cloud_of(scans[4]))
    assert level == OK
    assert (values['received'], values['processed'], values['paused']) == ('2', '2', '3')
    partner.spin_until(lambda: len(partner.odometry) == 2)
    assert_near(matrix_of(partner.odometry[1].pose.pose),
                np.linalg.inv(scans[0][3]) @ scans[4][3])
    assert node.stop() == 0


def given_pose(T, covariance, frame='odom'):
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose = pose(ros_type, T)
    message.pose.covariance = covariance.reshape(36)
    return message


def test_set_pose_begins_a_track_there(pair, scans):
    """The pose is of what is published, here the base; doubt about it stays in the covariance."""
    node, partner = pair('base_frame:=base_link', f'T_base_sensor:={MOUNT}')
    T_base_sensor = parse_transform(MOUNT, 'mount')
    start = parse_transform('100 50 3 0 0 2', 'start')
    doubt = np.diag([0.04, 0.04, 0.01, 1e-4, 1e-4, 9e-4])
    assert partner.outcome(cloud_of(scans[0]))[0] == OK
    publisher = partner.node.create_publisher(PoseWithCovarianceStamped, '/set_pose', 1)
    partner.spin_until(lambda: publisher.get_subscription_count() > 0)
    publisher.publish(given_pose(np.eye(4), doubt, 'map'))
    partner.spin_until(lambda: 'set_pose: in the frame map' in node.log.read_text())
    publisher.publish(given_pose(start, -doubt))
    partner.spin_until(lambda: 'set_pose: its covariance is not pos' in node.log.read_text())
    publisher.publish(given_pose(start, doubt))
    partner.spin_until(lambda: 'starts a new track there' in node.log.read_text())
    for scan in scans[1:]:
        assert partner.outcome(cloud_of(scan))[0] == OK
    partner.spin_until(lambda: len(partner.odometry) == len(scans))
    bases = [scan[3] @ np.linalg.inv(T_base_sensor) for scan in scans[1:]]
    for odometry, base in zip(partner.odometry[1:], bases, strict=True):
        assert_near(matrix_of(odometry.pose.pose), start @ np.linalg.inv(bases[0]) @ base)
        covariance = odometry.pose.covariance.reshape(6, 6)
        assert (np.diag(covariance) > 0.999 * np.diag(doubt)).all()
    np.testing.assert_allclose(partner.odometry[1].pose.covariance.reshape(6, 6), doubt,
                               atol=1e-12)
    assert node.stop() == 0


def test_a_frame_that_changes_is_told_and_has_no_slash(pair, scans):
    node, partner = pair()
    edges = partner.hear(Odometry, '/relative_pose')
    for scan, frame in zip(scans, ('/front', '/front', '/rear', '/rear'), strict=False):
        level, words, _ = partner.outcome(cloud_of(scan, frame))
        changed = frame == '/rear' and scan is scans[2]
        assert level == (WARN if changed else OK)
        assert ('changed from front to rear' in words) == changed
    partner.spin_until(lambda: len(partner.odometry) == 4)
    assert [odometry.child_frame_id for odometry in partner.odometry] == [
        'front', 'front', 'rear', 'rear']
    assert partner.odometry[2].twist.covariance[0] > 1e5    # not the motion of one sensor
    partner.spin_until(lambda: len(edges) == 3)
    assert node.log.read_text().count('first pose, of front in odom, at 100.000 s') == 1
    assert edges[1].header.frame_id.startswith('front@')
    assert edges[1].child_frame_id.startswith('rear@')
    assert 'changed from front to rear' in node.log.read_text()
    assert node.stop() == 0


def test_qos_overrides_work(pair):
    node, partner = pair('qos_overrides./odometry.publisher.reliability:=best_effort',
                         'qos_overrides./odometry.publisher.depth:=3',
                         'qos_overrides./points.subscription.depth:=1',
                         'qos_overrides./elsewhere.publisher.depth:=1')
    info, = partner.node.get_publishers_info_by_topic('/odometry')
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert 'overrides./elsewhere.publisher.depth: there is no such topic' in node.log.read_text()
    assert node.stop() == 0


@pytest.mark.parametrize(('override', 'words'), [
    ('qos_overrides./points.subscription.reliability:=best_effort', 'the parameter reliability'),
    ('qos_overrides./odometry.publisher.durability:=volatile', 'cannot be overridden'),
    ('qos_overrides./odometry.publisher.reliability:=quick', 'qos_overrides./odometry'),
    ('qos_overrides./points.subscription.history:=none', 'qos_overrides./points')])
def test_qos_overrides_that_cannot_work_are_refused(domain, override, words):
    ran = subprocess.run([sys.executable, '-m', 'sgor_ros.ros.main', '--ros-args', '-p', override],
                         env=domain.environment(), capture_output=True, text=True, timeout=240)
    assert ran.returncode == 2
    assert 'Traceback' not in ran.stderr
    assert 'error: ' in ran.stderr
    assert words in ran.stderr


TWO_NODES = """
import sys, rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sgor_ros.ros.node import SgorNode
rclpy.init()
executor = SingleThreadedExecutor()
nodes = [SgorNode('sgor_' + name, namespace=name,
                  parameter_overrides=[Parameter('odom_frame', value=name + '/odom')])
         for name in ('one', 'two')]
for node in nodes:
    executor.add_node(node)
    node.start()
while sum(node.counts().processed for node in nodes) < 6:
    executor.spin_once(0.1)
print([str(node.counts()) for node in nodes], all(node.stop() for node in nodes), flush=True)
rclpy.shutdown()
"""


def test_two_nodes_in_one_process(domain, scans):
    """Each with its own track, at the same time."""
    process = subprocess.Popen([sys.executable, '-c', TWO_NODES], stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True, env=domain.environment())
    partners = [ros.Partner(domain, f'/{name}/') for name in ('one', 'two')]
    try:
        for partner in partners:
            partner.wait_for_node(lambda: process.poll() is None)
        for first, second in zip(scans[:3], scans[3:], strict=True):
            partners[0].send(first[0], cloud_of(first))
            partners[1].send(second[0], cloud_of(second))
            for partner, scan in zip(partners, (first, second), strict=True):
                partner.spin_until(lambda heard=partner.heard_s, stamp=scan[0]: stamp in heard)
        for partner, name, track in zip(partners, ('one', 'two'), (scans[:3], scans[3:]),
                                        strict=True):
            assert partner.odometry[-1].header.frame_id == f'{name}/odom'
            assert_near(matrix_of(partner.odometry[-1].pose.pose),
                        np.linalg.inv(track[0][3]) @ track[-1][3])
        said = process.communicate(timeout=60)[0]
        assert process.returncode == 0, said
        assert said.splitlines()[-1].endswith('True')
    finally:
        process.kill()
        for partner in partners:
            partner.close()
