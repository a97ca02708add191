"""The node as users have it: a process of its own, real DDS, real clouds."""
from importlib.util import find_spec
import json
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import DescribeParameters
from rcl_interfaces.srv import GetParameters
from rcl_interfaces.srv import ListParameters
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
import ros_helpers as ros
from ros_helpers import status
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker
from visualization_msgs.msg import MarkerArray
import yaml

from sgor_ros import SgorConfig
from sgor_ros import TrackerConfig
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.parameters import MAP_FOLDER
from sgor_ros.ros.parameters import NodeConfig
from sgor_ros.ros.parameters import yaml_files
from sgor_ros.ros.playback.node_process import NodeProcess
from sgor_ros.ros.playback.player import SETTLING_S
from sgor_ros.ros.types import ros_type
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

ROOT = Path(__file__).resolve().parents[2]
OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'
SECOND = 1_000_000_000
SMALL = Lidar(beams=32, columns=600)
TOLERANCE_M, TOLERANCE_RAD = 0.15, 0.02
FLOAT32, FLOAT64 = 7, 8
STUDIED = {'predict_first': 'true', 'groups': 500, 'semantics': 'loose', 'normal_radius': 1.5}


@pytest.fixture(scope='module')
def street():
    """Return the first scans of a drive: [(stamp in ns, points, labels, true pose)]."""
    return [(100 * SECOND + round(stamp * SECOND), points, labels, pose)
            for stamp, points, labels, pose in simulate(8, seed=0, lidar=SMALL)]


@pytest.fixture(scope='module')
def shared_node(domain, tmp_path_factory):
    # settings for studies are parameters only where they are given
    studies = [f'{name}:={value}' for name, value in STUDIED.items()]
    node = NodeProcess(domain, tmp_path_factory.mktemp('node') / 'log',
                       *(part for each in studies for part in ('-p', each)))
    yield node
    node.stop()


@pytest.fixture(scope='module')
def shared_partner(domain, shared_node):
    partner = ros.Partner(domain)
    partner.wait_for_node()
    yield partner
    partner.close()


@pytest.fixture
def partner(shared_partner, shared_node):
    """Start with a node that has forgotten what other tests sent; it must survive the test."""
    assert shared_node.alive(), shared_node.log.read_text()
    shared_partner.spin_for(0.1)
    assert shared_partner.call(Trigger, '/reset', Trigger.Request()).success
    shared_partner.forget()
    yield shared_partner
    assert shared_node.alive(), shared_node.log.read_text()


def clouds_of(scans):
    return [ros.cloud(points, labels, stamp) for stamp, points, labels, _ in scans]


def assert_right(odometry, scan, first):
    true = np.linalg.inv(first[3]) @ scan[3]
    metres, radians = ros.difference(matrix_of(odometry.pose.pose), true)
    assert metres < TOLERANCE_M
    assert radians < TOLERANCE_RAD


def test_each_scan_gives_odometry_and_pose_with_its_stamp(partner, street):
    for cloud in clouds_of(street):
        assert partner.outcome(cloud)[0] == OK
    partner.spin_until(lambda: len(partner.poses) == len(partner.odometry) == len(street))
    for odometry, pose, scan in zip(partner.odometry, partner.poses, street, strict=True):
        for header in (odometry.header, pose.header):
            assert ros.stamp_ns_of(header) == scan[0]
            assert header.frame_id == 'odom'
        assert odometry.child_frame_id == 'lidar'
        assert pose.pose == odometry.pose.pose
        assert_right(odometry, scan, street[0])
    # 6 m/s straight ahead, and covariances that are some
    assert partner.odometry[-1].twist.twist.linear.x == pytest.approx(6.0, abs=0.6)
    for part in (partner.odometry[-1].pose, partner.odometry[-1].twist):
        variances = np.linalg.eigvalsh(part.covariance.reshape(6, 6))
        assert variances.min() > 0
        assert variances.max() < 1


def test_diagnostics_add_up(partner, street):
    values = [partner.outcome(cloud)[2] for cloud in clouds_of(street[:3])]
    counts = [{name: int(value[name]) for name in ('received', 'processed', 'replaced', 'failed')}
              for value in values]
    for count in counts:
        assert count['received'] == count['processed'] + count['replaced'] + count['failed']
    assert counts[2]['processed'] - counts[0]['processed'] == 2
    assert float(values[2]['confidence']) > 0.5
    assert 10 < int(values[2]['inliers']) <= int(values[2]['correspondences'])
    assert 0 < float(values[2]['seconds']) <= float(values[2]['latency'])


def test_newest_scan_wins_under_overload(partner, street):
    first = int(partner.outcome(clouds_of(street)[0])[2]['received'])
    burst = clouds_of(street[1:] * 3)
    for index, cloud in enumerate(burst):
        cloud.header.stamp.sec = 200
        cloud.header.stamp.nanosec = 10_000_000 * index
    partner.play(ros.stamped(burst), 0.01)
    last = ros.stamp_ns_of(burst[-1].header)
    partner.spin_until(
        lambda: partner.diagnostics
        and ros.stamp_ns_of(partner.diagnostics[-1].header) == last)
    values = status(partner.diagnostics[-1])[2]
    assert int(values['replaced']) > 0
    assert int(values['received']) > first + len(burst) // 2
    assert int(values['received']) == sum(int(values[name])
                                          for name in ('processed', 'replaced', 'failed'))
    stamps = [ros.stamp_ns_of(message.header) for message in partner.diagnostics]
    assert stamps == sorted(stamps)


def test_markers_for_those_who_listen(partner, street):
    seen = []
    listener = partner.node.create_subscription(MarkerArray, '/correspondences', seen.append, 1)
    partner.spin_until(lambda: partner.node.count_publishers('/correspondences') == 1)
    partner.spin_for(SETTLING_S)
    first, second = clouds_of(street[:2])
    partner.outcome(first)
    values = partner.outcome(second)[2]
    partner.spin_until(lambda: len(seen) == 2)
    partner.node.destroy_subscription(listener)
    assert [marker.action for marker in seen[0].markers] == [Marker.DELETEALL]
    lines = {marker.ns: marker for marker in seen[1].markers}
    assert set(lines) == {'inliers', 'rejected'}
    assert 0 < len(lines['inliers'].points) <= 2 * int(values['inliers'])
    for marker in lines.values():
        assert marker.header.frame_id == 'odom'
        assert ros.stamp_ns_of(marker.header) == street[1][0]
    # inliers join what is the same place: short lines
    ends = np.array([[p.x, p.y, p.z] for p in lines['inliers'].points]).reshape(-1, 2, 3)
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() < SgorConfig().tau_1


def test_reset_makes_the_next_scan_the_origin(partner, street):
    for cloud in clouds_of(street[:3]):
        partner.outcome(cloud)
    assert partner.call(Trigger, '/reset', Trigger.Request()).success
    for cloud in clouds_of(street[5:7]):
        partner.outcome(cloud)
    partner.spin_until(lambda: len(partner.odometry) == 5)
    np.testing.assert_array_equal(matrix_of(partner.odometry[3].pose.pose), np.eye(4))
    assert_right(partner.odometry[4], street[6], street[5])


def set_parameter(partner, name, value):
    message: ParameterMessage = Parameter(name, value=value).to_parameter_msg()
    answer = partner.call(SetParameters, '/sgor_node/set_parameters',
                          SetParameters.Request(parameters=[message]))
    return answer.results[0]


def test_a_parameter_changed_on_the_way_takes_effect(partner, street):
    first, second, third, fourth = clouds_of(street[:4])
    # so that every scan is matched
    assert set_parameter(partner, 'predict_first', False).successful
    partner.outcome(first)
    assert int(partner.outcome(second)[2]['correspondences']) > 60
    assert set_parameter(partner, 'max_correspondences', 60).successful
    assert int(partner.outcome(third)[2]['correspondences']) <= 60
    assert set_parameter(partner, 'max_correspondences', 8000).successful
    assert set_parameter(partner, 'mode', 'consecutive').successful
    level, _, values = partner.outcome(fourth)
    assert level == OK
    assert int(values['correspondences']) > 60
    assert set_parameter(partner, 'mode', 'keyframe').successful
    assert set_parameter(partner, 'predict_first', True).successful


@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('sigma_g', 9.0, ['sigma_g', '9.0', '5.0']),
    ('sigma_theta', float('nan'), ['sigma_theta', 'nan']),
    ('groups', 0, ['groups', '0', '5000']),
    ('sigma_d', 1, ['DOUBLE', 'INTEGER']),
    ('semantics', 'fuzzy', ['semantics', 'fuzzy', 'loose, hard, none']),
    ('normal_radius', 4.0, ['normal_radius = 4.0', 'descriptor_radius = 3.5']),
    ('label_convention', 'mine', ['mine', 'semantickitti']),
    ('label_field', 'class', ['read-only', 'label_field']),
])
def test_a_refused_parameter_says_why(partner, name, value, words):
    result = set_parameter(partner, name, value)
    assert not result.successful
    for word in words:
        assert word in result.reason


def test_parameters_carry_meaning_unit_and_range(partner):
    settings = {item.name: item for config in (SgorConfig, TrackerConfig, NodeConfig)
                for item in config.shown()}
    answer = partner.call(DescribeParameters, '/sgor_node/describe_parameters',
                          DescribeParameters.Request(names=list(settings)))
    for descriptor, item in zip(answer.descriptors, settings.values(), strict=True):
        assert descriptor.description == item.description
        limits = [*descriptor.floating_point_range, *descriptor.integer_range]
        assert [(x.from_value, x.to_value) for x in limits] == (
            [] if item.minimum is None else [(item.minimum, item.maximum)])
        assert descriptor.read_only == (item.name in NodeConfig.__dataclass_fields__
                                        and item.name != MAP_FOLDER)


def test_settings_for_studies_are_parameters_only_where_they_are_given(partner):
    names = partner.call(ListParameters, '/sgor_node/list_parameters',
                         ListParameters.Request()).result.names
    studies = {item.name for config in (SgorConfig, TrackerConfig)
               for item in {*config.settings()} - {*config.shown()}}
    assert studies & {*names} == {*STUDIED}


def test_names_of_before_and_misspelt_ones_are_told(domain, tmp_path):
    arguments = ('-p', 'rival_radius:=12.0', '-p', 'hypothesis_radios:=3.0')
    with NodeProcess(domain, tmp_path / 'log', *arguments, '-r', '__node:=renamed') as node:
        partner = ros.Partner(domain)
        answer = partner.call(GetParameters, '/renamed/get_parameters', GetParameters.Request(
            names=['hypothesis_radius']))
        partner.close()
        assert node.stop() == 0
    assert answer.values[0].double_value == 12.0
    told = node.log.read_text()
    assert 'parameter rival_radius: it is hypothesis_radius now' in told
    assert 'parameter hypothesis_radios: there is none of that name' in told
    assert 'parameter rival_radius: there is none' not in told


def without_label(cloud):
    cloud.fields = [field for field in cloud.fields if field.name != 'label']


def empty(cloud):
    cloud.width = cloud.row_step = 0
    cloud.data = cloud.data[:0]


def truncated(cloud):
    cloud.data = cloud.data[:-100]


def field_of_type(datatype):
    def change(cloud):
        cloud.fields[-1].datatype = datatype
    return change


def a_fraction(cloud):
    field_of_type(FLOAT32)(cloud)
    records = np.frombuffer(cloud.data, np.uint8).reshape(-1, 16).copy()
    records[:, 12:] = np.frombuffer(np.float32(40.5).tobytes(), np.uint8)
    cloud.data[:] = type(cloud.data)('B', records.tobytes())


def all_nan(cloud):
    cloud.data[:] = type(cloud.data)('B', np.full(len(cloud.data) // 4, np.nan, '<f4').tobytes())


@pytest.mark.parametrize(('spoil', 'words'), [
    (empty, ['0', 'empty']),
    (all_nan, ['finite']),
    (truncated, ['data', 'bytes']),
    (field_of_type(FLOAT64), ['label', 'point_step']),
    (a_fraction, ['label', '40.5', 'not a whole number']),
    (field_of_type(99), ['label', '99']),
], ids=['no points', 'all NaN', 'truncated', 'label too wide',
        'label a fraction', 'label of no type'])
def test_a_bad_cloud_is_named_and_the_node_goes_on(partner, shared_node, street, spoil, words):
    first, bad, good = clouds_of(street[:3])
    spoil(bad)
    assert partner.outcome(first)[0] == OK
    level, message, _ = partner.outcome(bad)
    assert level == ERROR
    for word in words:
        assert word in message
    assert message in shared_node.log.read_text()
    assert partner.outcome(good)[0] == OK
    partner.spin_until(lambda: len(partner.odometry) == 2)
    assert ros.stamp_ns_of(partner.odometry[1].header) == street[2][0]
    assert_right(partner.odometry[1], street[2], street[0])


def test_a_cloud_without_labels_is_worked_on_without(partner, shared_node, street):
    bare = clouds_of(street[:3])
    for cloud in bare:
        without_label(cloud)
        assert partner.outcome(cloud)[0] != ERROR
    partner.spin_until(lambda: len(partner.odometry) == 3)
    assert_right(partner.odometry[2], street[2], street[0])
    assert shared_node.log.read_text().count('works without labels: none of') == 1


@pytest.mark.parametrize(('field', 'words'), [
    ('x', 'field x: it holds coordinates'), ('nonsense', 'field nonsense: the cloud has none')])
def test_a_wrong_label_field_is_told_and_kills_nothing(domain, street, tmp_path, field, words):
    with NodeProcess(domain, tmp_path / 'log', '-r', '__ns:=/wrong', '-p',
                     f'label_field:={field}') as node, ros.Partner(domain, '/wrong/') as partner:
        partner.wait_for_node(node.alive)
        for cloud in clouds_of(street[:3]):
            level, message, _ = partner.outcome(cloud)
            assert level == ERROR
            assert words in message
        assert node.stop() == 0
    assert node.log.read_text().count(words) == 1
    assert 'failed 3' in node.log.read_text()


def test_class_ids_are_read_from_the_field_of_another_name(domain, street, tmp_path):
    """As Autoware writes them; and a wrong convention is told in a short line."""
    with NodeProcess(domain, tmp_path / 'log', '-r', '__ns:=/class') as node, \
            ros.Partner(domain, '/class/') as partner:
        partner.wait_for_node(node.alive)
        for (stamp, points, labels, _), shift in zip(street[:3], (0, 0, 5000), strict=True):
            cloud = ros.cloud(points, labels + shift, stamp)
            cloud.fields[-1].name = 'class_id'
            level, message, _ = partner.outcome(cloud)
        assert level != OK
        assert '100% of the points: is label_convention right?' in message
        assert node.stop() == 0
    log = node.log.read_text()
    assert log.count('class ids are read from the field class_id') == 1
    assert max(map(len, log.splitlines())) < 500


@pytest.mark.parametrize('rows', [slice(1), slice(40)], ids=['one point', 'forty points'])
def test_too_few_points_fail_without_a_pose(partner, street, rows):
    first, _, good = clouds_of(street[:3])
    stamp, points, labels, _ = street[1]
    assert partner.outcome(first)[0] == OK
    level, message, values = partner.outcome(ros.cloud(points[rows], labels[rows], stamp))
    assert level == ERROR
    assert values['reason']
    assert values['reason'] in message
    assert partner.outcome(good)[0] == OK
    partner.spin_until(lambda: len(partner.odometry) == 2)
    assert_right(partner.odometry[1], street[2], street[0])


def test_a_late_scan_is_dropped_and_wipes_nothing(partner, street):
    """Two scans swapped, one twice, and one whose stamp nobody has set."""
    clouds = clouds_of(street[:5])
    clouds[3].header.stamp.sec = clouds[3].header.stamp.nanosec = 0
    before = int(partner.outcome(clouds[0])[2]['late'])
    for index, late in ((2, False), (1, True), (2, True), (3, True), (4, False)):
        level, message, values = partner.outcome(clouds[index])
        assert level == (WARN if late else OK)
        assert ('dropped, for it came late' in message) == late
        assert (values['state'] == 'late') == late
    assert int(values['late']) == before + 3
    assert int(values['received']) == sum(int(values[name]) for name in (
        'processed', 'failed', 'late', 'replaced'))
    partner.spin_until(lambda: len(partner.odometry) == 3)
    for odometry, scan in zip(partner.odometry, (street[0], street[2], street[4]), strict=True):
        assert_right(odometry, scan, street[0])


def test_a_bag_that_starts_over_is_a_new_track(partner, shared_node, street):
    clouds = clouds_of([street[0], street[1]] + street[:3])
    for cloud in clouds[:2]:
        cloud.header.stamp.sec += 10
    tracks = []
    for cloud in clouds:
        level, message, values = partner.outcome(cloud)
        tracks.append(values['track'])
        if values['state'] == 'new track' and len(tracks) > 1:
            assert level == WARN
            assert 'time ran backwards' in message
    assert tracks[1] != tracks[-1]
    assert 'time ran backwards' in shared_node.log.read_text()
    # the first scan of the new round only shows that the clock has gone back
    partner.spin_until(lambda: len(partner.odometry) == 4)
    np.testing.assert_allclose(matrix_of(partner.odometry[2].pose.pose), np.eye(4), atol=1e-9)
    assert_right(partner.odometry[3], street[2], street[1])


def test_the_twist_is_that_of_now(partner, street):
    """Driving, then standing: not the mean since the keyframe."""
    stamp, points, labels, _ = street[-1]
    for cloud in clouds_of(street):
        partner.outcome(cloud)
    for step in range(1, 6):
        partner.outcome(ros.cloud(points, labels, stamp + step * SECOND // 10))
    partner.spin_until(lambda: len(partner.odometry) == len(street) + 5)
    assert partner.odometry[len(street) - 1].twist.twist.linear.x == pytest.approx(6, abs=0.6)
    assert abs(partner.odometry[-1].twist.twist.linear.x) < 0.3


def test_labels_of_an_unknown_class_are_named_once(partner, shared_node, street):
    stamp, points, labels, _ = street[0]
    for step in range(2):
        strange = np.where(np.arange(len(labels)) < 50, 23456, labels)
        level, message, _ = partner.outcome(
            ros.cloud(points, strange, stamp + step * SECOND // 10))
        assert level == WARN
        assert '23456' in message
    assert shared_node.log.read_text().count('23456') == 1


@pytest.fixture(scope='module')
def kitti(data_folder):
    """Return ten consecutive KITTI scans like `street`, at 10 Hz."""
    folder = data_folder / 'kitti/08'
    calibration = dict(line.split(':') for line in
                       (folder / 'calib.txt').read_text().splitlines() if ':' in line)
    Tr = np.vstack((np.array(calibration['Tr'].split(), float).reshape(3, 4), [0, 0, 0, 1]))
    scans = []
    for index, P in enumerate(np.loadtxt(folder / 'poses.txt').reshape(-1, 3, 4)[:10]):
        points = np.fromfile(folder / f'velodyne/{index:06d}.bin', np.float32).reshape(-1, 4)
        labels = np.fromfile(folder / f'labels/{index:06d}.label', np.uint32)
        pose = np.linalg.inv(Tr) @ np.vstack((P, [0, 0, 0, 1])) @ Tr
        scans.append((100 * SECOND + index * SECOND // 10, points[:, :3], labels, pose))
    return scans


def assert_good_end(odometry, kitti):
    assert ros.stamp_ns_of(odometry.header) == kitti[-1][0]
    metres, radians = ros.difference(matrix_of(odometry.pose.pose),
                                     np.linalg.inv(kitti[0][3]) @ kitti[-1][3])
    assert metres < 0.3
    assert np.degrees(radians) < 1.0


def test_real_scans_one_after_another(partner, kitti):
    for cloud in clouds_of(kitti):
        assert partner.outcome(cloud)[0] == OK
    partner.spin_until(lambda: len(partner.odometry) == len(kitti))
    assert [ros.stamp_ns_of(message.header) for message in partner.odometry] == [
        scan[0] for scan in kitti]
    assert_good_end(partner.odometry[-1], kitti)


def test_real_scans_at_ten_hertz(partner, kitti):
    """None is lost on the way, and each is processed or, on a busy machine, replaced."""
    before = partner.outcome(clouds_of(kitti)[0])[2]
    partner.play(ros.stamped(clouds_of(kitti[1:])), 0.1)
    partner.spin_until(lambda: partner.odometry and ros.stamp_ns_of(
        partner.odometry[-1].header) == kitti[-1][0])
    partner.spin_until(lambda: len(partner.diagnostics) == len(partner.odometry))
    after = status(partner.diagnostics[-1])[2]
    replaced = int(after['replaced']) - int(before['replaced'])
    assert int(after['received']) - int(before['received']) == len(kitti) - 1
    assert len(partner.odometry) == len(kitti) - replaced
    assert_good_end(partner.odometry[-1], kitti)


def test_users_files_namespace_and_a_best_effort_driver(domain, street, tmp_path):
    """Two files, the later one wins; the driver is best effort, time is the bag's."""
    mine = tmp_path / 'mine.yaml'
    mine.write_text('/**:\n  ros__parameters:\n    odom_frame: start\n    sensor_frame: velodyne\n'
                    '    sigma_gg: 1.0\n    use_sim_time: true\n')
    node = NodeProcess(domain, tmp_path / 'log', '--params-file',
                       str(ROOT / 'config/sgor_node.yaml'), '--params-file', str(mine),
                       '-r', '__ns:=/robot')
    partner = None
    try:
        silent = ros.Partner(domain, '/unheard/')
        silent.spin_until(lambda: 'no clouds on /robot/points yet' in node.log.read_text(), 60.0)
        silent.close()
        assert '/unheard/points' in node.log.read_text()
        assert 'sigma_gg' in node.log.read_text()
        partner = ros.Partner(domain, '/robot/', ReliabilityPolicy.BEST_EFFORT)
        partner.spin_until(lambda: 'best effort' in node.log.read_text())
        partner.wait_for_node()
        for cloud in clouds_of(street[:2]):
            assert partner.outcome(cloud)[0] == OK
        partner.spin_until(lambda: len(partner.odometry) == 2)
        assert partner.odometry[1].header.frame_id == 'start'
        assert partner.odometry[1].child_frame_id == 'velodyne'
        assert_right(partner.odometry[1], street[1], street[0])
    finally:
        assert node.stop() == 0
        if partner:
            partner.close()


def test_a_reliable_only_node_says_what_it_cannot_hear(domain, tmp_path):
    node = NodeProcess(domain, tmp_path / 'log', '-r', '__ns:=/strict', '-p',
                           'reliability:=reliable')
    partner = ros.Partner(domain, '/strict/', ReliabilityPolicy.BEST_EFFORT)
    try:
        partner.spin_until(lambda: 'incompatible QoS (RELIABILITY)' in node.log.read_text(), 60.0)
    finally:
        node.stop()
        partner.close()


@pytest.mark.parametrize(('argument', 'words'), [
    ('sigma_g:=9.0', ['sigma_g', '9.0', '5.0']),
    pytest.param('publish_tf:=true', ['publish_tf', 'ros-jazzy-tf2-msgs'],
                 marks=pytest.mark.skipif(find_spec('tf2_msgs') is not None,
                                          reason='tf2_msgs is installed')),
])
def test_what_cannot_work_ends_the_start_with_a_message(domain, argument, words):
    ran = subprocess.run([sys.executable, '-m', 'sgor_ros.ros.main', '--ros-args', '-p', argument],
                         env=domain.environment(), cwd=ROOT, capture_output=True, text=True,
                         timeout=60)
    assert ran.returncode == 2
    assert ran.stderr.startswith('error: ')
    assert 'Traceback' not in ran.stderr
    for word in words:
        assert word in ran.stderr


def test_yaml_files_are_what_the_settings_say():
    for name, content in yaml_files().items():
        assert (ROOT / 'config' / name).read_text() == content, (
            'run python -m sgor_ros.ros.parameters config')


def test_layouts_of_rviz_and_foxglove_show_its_topics(partner):
    names = ('sgor_node', '/')
    topics = {**dict(partner.node.get_publisher_names_and_types_by_node(*names)),
              **dict(partner.node.get_subscriber_names_and_types_by_node(*names))}
    kinds = {name: kind for name, (kind, *_) in topics.items()}
    rviz = yaml.safe_load((ROOT / 'config/sgor.rviz').read_text())['Visualization Manager']
    shown = {'/' + display['Topic']['Value']: display['Class'].rpartition('/')[2]
             for display in rviz['Displays'] if 'Topic' in display}
    assert shown == {'/points': 'PointCloud2', '/odometry': 'Odometry',
                     '/correspondences': 'MarkerArray'}
    for topic, display in shown.items():
        assert kinds[topic].rpartition('/')[2] == display
    assert rviz['Global Options']['Fixed Frame'] == NodeConfig().odom_frame
    panels = json.loads((ROOT / 'config/sgor.foxglove.json').read_text())['configById']
    assert shown.keys() <= panels['3D!sgor']['topics'].keys() <= kinds.keys()
    assert panels['3D!sgor']['followTf'] == NodeConfig().odom_frame
    told = panels['DiagnosticStatusPanel!sgor']['topicToRender']
    assert kinds[told] == 'diagnostic_msgs/msg/DiagnosticArray'
    paths = [path['value'] for panel in panels.values() for path in panel.get('paths', ())]
    assert len(paths) == 4
    for path in paths:
        topic, *fields = path.split('.')
        value = ros_type(kinds[topic])()
        for field in fields:
            name, _, index = field.partition('[')
            value = getattr(value, name)
            value = value[int(index.rstrip(']'))] if index else value
        assert isinstance(value, float)
