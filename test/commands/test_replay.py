"""`sgor_replay` over bags good and bad: the same poses as the tracker, and never a traceback."""
import json
import re
import shutil

from conftest import errors
from conftest import PERIOD_NS
from conftest import relative
from conftest import write_bag
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import Tracker
from sgor_ros.commands.kitti_to_bag import main as kitti_to_bag
from sgor_ros.commands.replay import main
from sgor_ros.evaluation.report.track_plots import COLOURS
from sgor_ros.evaluation.report.track_plots import plot_track
from sgor_ros.io.bags import BagReader
from sgor_ros.io.bags import BagWriter
from sgor_ros.io.colours import LOST
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import header
from sgor_ros.io.messages import matrix_of
from sgor_ros.io.messages import point_cloud2
from sgor_ros.io.trajectories import read_kitti

CLOUD = 'sensor_msgs/msg/PointCloud2'


@pytest.fixture(scope='module')
def replayed(street_bag, tmp_path_factory):
    """Return the output folder of a replay of the street with a bag of results."""
    output = tmp_path_factory.mktemp('out') / 'deep/er'
    assert main([str(street_bag), '--output', str(output), '--bag']) == 0
    return output


def summary(folder):
    return json.loads((folder / 'summary.json').read_text())


def test_poses_are_those_of_the_tracker(street, replayed):
    tracker = Tracker()
    expected = [tracker.track(SemanticScan(points, labels), i * PERIOD_NS).T_odom_sensor
                for i, (points, labels, _) in enumerate(street)]
    np.testing.assert_allclose(read_kitti(replayed / 'trajectory_kitti.txt'), expected, atol=1e-8)


def test_poses_are_right(street, replayed):
    poses = read_kitti(replayed / 'trajectory_kitti.txt')
    for T, (*_, T_world_sensor) in zip(poses, street, strict=True):
        metres, degrees = errors(T, relative(street[0][2], T_world_sensor))
        assert metres < 0.15
        assert degrees < 0.3


def test_tum_has_stamps_and_quaternions(replayed):
    rows = np.loadtxt(replayed / 'trajectory.tum')
    poses = read_kitti(replayed / 'trajectory_kitti.txt')
    np.testing.assert_allclose(rows[:, 0], [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(rows[:, 1:4], poses[:, :3, 3], atol=1e-8)
    x, y, z, w = rows[-1, 4:]
    assert 2 * (x * y + z * w) == pytest.approx(poses[-1, 1, 0], abs=1e-8)


def test_summary_and_picture(replayed):
    result = summary(replayed)
    assert (result['scans'], result['successes'], result['failures']) == (4, 4, [])
    assert result['topic'] == '/points'
    assert result['restarts'] == [0]
    assert result['parameters']['sigma_d'] == SgorConfig().sigma_d
    assert result['parameters']['mode'] == 'keyframe'
    assert result['environment']['numpy'] == np.__version__
    timings = result['timings_ms']
    assert {'total', 'preprocessing', 'matching', 'consistency'} <= timings.keys()
    assert 0 < timings['total']['median'] <= timings['total']['p95']
    assert (replayed / 'trajectory.png').read_bytes().startswith(b'\x89PNG')


def test_results_in_a_bag(replayed):
    poses = read_kitti(replayed / 'trajectory_kitti.txt')
    with AnyReader([replayed / 'bag']) as bag:
        found = {topic: [] for topic in bag.topics}
        for connection, time_ns, raw in bag.messages():
            found[connection.topic].append((time_ns, bag.deserialize(raw, connection.msgtype)))
    assert found.keys() == {'/odometry', '/pose', '/relative_pose', '/correspondences'}
    for i, (time_ns, message) in enumerate(found['/odometry']):
        assert time_ns == stamp_ns_of(message.header) == i * PERIOD_NS
        assert (message.header.frame_id, message.child_frame_id) == ('odom', 'lidar')
        p = message.pose.pose.position
        np.testing.assert_allclose([p.x, p.y, p.z], poses[i, :3, 3], atol=1e-8)
    assert [len(m.markers[0].points) > 20 for _, m in found['/correspondences']] == [
        False, True, True, True]    # the first scan has nothing to compare with


def test_existing_folders_are_refused(street_bag, replayed, capsys):
    before = {path: path.stat().st_mtime_ns for path in replayed.rglob('*')}
    for folder in (replayed, street_bag):
        assert main([str(street_bag), '--output', str(folder)]) == 2
        assert f'{folder}: exists already' in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in replayed.rglob('*')} == before


def test_results_of_their_own_beside_the_bag(street_bag, tmp_path, monkeypatch, capsys):
    """As README has it: a bag in out/, and a second replay of it."""
    shutil.copytree(street_bag, tmp_path / 'out/08')
    monkeypatch.chdir(tmp_path)
    for name in ('08_replay', '08_replay_2'):
        assert main(['out/08']) == 0
        assert f'wrote out/{name}: summary.json, trajectory.png' in capsys.readouterr().out
        assert summary(tmp_path / 'out' / name)['successes'] == 4
    assert {path.name for path in (tmp_path / 'out').iterdir()} == {
        '08', '08_replay', '08_replay_2'}
    assert len(list((tmp_path / 'out/08').iterdir())) == 2


def test_presets_and_a_run_in_which_nothing_is_registered(street_bag, tmp_path, capsys):
    assert main([str(street_bag), '--output', str(tmp_path / 'a'), '--preset', 'paper',
                 '--sigma-g', '0.2']) == 0
    parameters = summary(tmp_path / 'a')['parameters']
    assert parameters['local_refinement'] is SgorConfig.paper().local_refinement is False
    assert parameters['sigma_g'] == 0.2
    assert main([str(street_bag), '--output', str(tmp_path / 'b'), '--min-inliers',
                 '10000']) == 1
    assert 'no scan could be registered to another' in capsys.readouterr().err
    assert summary(tmp_path / 'b')['scans'] == 4


def test_settings_by_option_and_by_file(street_bag, tmp_path):
    params = tmp_path / 'p.yaml'
    params.write_text('/**:\n  ros__parameters:\n    mode: consecutive\n    sigma_d: 0.5\n')
    assert main([str(street_bag), '--output', str(tmp_path / 'out'), '--params-file', str(params),
                 '--sigma-d', '0.7', '--odom-frame', 'map']) == 0
    parameters = summary(tmp_path / 'out')['parameters']
    assert (parameters['mode'], parameters['sigma_d'], parameters['odom_frame']) == (
        'consecutive', 0.7, 'map')


def cdr(message):
    store = get_typestore(Stores.ROS2_JAZZY)
    return bytes(store.serialize_cdr(message, message.__msgtype__))


def write_raw(path, messages, topic='/points'):
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connection = bag.add_connection(topic, CLOUD, typestore=store)
        for time_ns, raw in messages:
            bag.write(connection, time_ns, raw)
    return path


def cloud_of(street, i, stamp_ns):
    types = get_typestore(Stores.ROS2_JAZZY).types.__getitem__
    return point_cloud2(types, *street[i][:2], stamp_ns, 'lidar')


def test_broken_clouds_are_left_out(street, tmp_path, capsys):
    short = cloud_of(street, 1, PERIOD_NS)
    short.data = short.data[:1000]
    empty = cloud_of(street, 1, 2 * PERIOD_NS)
    empty.width, empty.row_step, empty.data = 0, 0, empty.data[:0]
    nan = point_cloud2(get_typestore(Stores.ROS2_JAZZY).types.__getitem__,
                       np.full((5, 3), np.nan), np.zeros(5, int), 3 * PERIOD_NS, 'lidar')
    bag = write_raw(tmp_path / 'bag', [
        (0, cdr(cloud_of(street, 0, 0))), (1, cdr(short)), (2, cdr(empty)), (3, cdr(nan)),
        (4 * PERIOD_NS, cdr(cloud_of(street, 1, 4 * PERIOD_NS))[:300]),
        (5 * PERIOD_NS, cdr(cloud_of(street, 1, 5 * PERIOD_NS)))])
    assert main([str(bag), '--output', str(tmp_path / 'out')]) == 0
    result = summary(tmp_path / 'out')
    assert [failure['scan'] for failure in result['failures']] == [1, 2, 3, 4]
    said = capsys.readouterr().err
    for text in ('data: 1000 bytes', 'the cloud is empty', 'none of 5 is finite',
                 'cannot be read'):
        assert text in said
    poses = read_kitti(tmp_path / 'out/trajectory_kitti.txt')
    assert np.isnan(poses[1:5, :3]).all(), 'one row a scan, so that rows and scans stay in step'
    assert errors(poses[5], relative(street[0][2], street[1][2]))[0] < 0.1
    assert len(np.loadtxt(tmp_path / 'out/trajectory.tum')) == 2


def test_time_that_runs_backwards_starts_anew(street, tmp_path, capsys):
    bag = tmp_path / 'bag'
    write_bag(bag, [(*street[k][:2], (7 + 20 * k) * PERIOD_NS) for k in range(3)])
    with BagReader(bag) as reader:
        raw = [cdr(cloud.read()[2]) for cloud in reader.clouds('/points')]
    again = write_raw(tmp_path / 'again', list(enumerate([*raw, *raw])))
    assert main([str(again), '--output', str(tmp_path / 'out')]) == 0
    # the first that falls back may be late, the second confirms the jump
    assert summary(tmp_path / 'out')['restarts'] == [0, 4]
    said = capsys.readouterr()
    assert 'time ran backwards' in said.err
    assert '2 tracks, each in a frame of its own: trajectory.tum is the first, ' \
        'trajectory_2.tum the second\n' in said.out
    first, second = (read_kitti(tmp_path / f'out/trajectory_kitti{number}.txt')
                     for number in ('', '_2'))
    known = [np.flatnonzero(~np.isnan(poses[:, 0, 0])).tolist() for poses in (first, second)]
    assert known == [[0, 1, 2], [4, 5]], 'scan 3 came late'
    np.testing.assert_array_equal(second[4], np.eye(4))
    for number, count in (('', 3), ('_2', 2)):
        rows = np.loadtxt(tmp_path / f'out/trajectory{number}.tum', ndmin=2)
        assert len(rows) == count
        assert np.linalg.norm(np.diff(rows[:, 1:4], axis=0), axis=1).max() < 2.0, 'no jump'
    assert [(track['scans']) for track in summary(tmp_path / 'out')['tracks']] == [3, 2]


def test_a_picture_draws_no_line_from_track_to_track(tmp_path):
    poses = [np.eye(4) for _ in range(7)]
    for pose, x in zip(poses, (0, 1, 2, 0, 1, 2, 3), strict=True):
        pose[0, 3] = x
    poses[5] = None
    plot_track(tmp_path / 'a.svg', 'two', np.arange(7) / 10, poses, [0.1] * 7, [0.9] * 7,
               [1, 1, 1, 2, 2, 2, 2], {})
    drawn = (tmp_path / 'a.svg').read_text()
    lines = [len(re.findall('[ML] ', path)) for colour in (*COLOURS[:2], LOST) for path in
             re.findall(rf'<path d="([^"]*)"[^>]*stroke: {colour}; stroke-width: 2', drawn)]
    # three poses each, and three dots each in the legend; the gap of the second
    assert sorted(lines) == [2, 3, 3, 3, 3]


def test_missing_label_field_tells_the_fields(street, tmp_path, capsys):
    bag = write_bag(tmp_path / 'bag', [(street[0][0], None, 0), (street[1][0], None, PERIOD_NS)])
    assert main([str(bag), '--output', str(tmp_path / 'out'), '--label-field', 'label']) == 2
    assert 'none of 2 clouds could be used: field label: the cloud has none; its fields are ' \
        'x, y, z' in capsys.readouterr().err
    assert main([str(bag), '--output', str(tmp_path / 'out'), '--label-field', 'x']) == 2
    assert 'field x: it holds coordinates' in capsys.readouterr().err
    for field, told in (('auto', 1), ('none', 0)):
        assert main([str(bag), '--output', str(tmp_path / field), '--label-field', field]) == 0
        assert summary(tmp_path / field)['successes'] == 2
        assert capsys.readouterr().err.count('works without labels') == told


def test_the_track_of_a_base(street, street_bag, tmp_path, capsys):
    """As the node publishes it: the base begins at the origin, whatever the sensor sees."""
    mount = '1.2 -0.3 1.8 0.05 0.1 1.5'
    options = ['--output', str(tmp_path / 'out'), '--base-frame', 'base_link']
    assert main([str(street_bag), *options]) == 2
    assert 'it needs T_base_sensor' in capsys.readouterr().err
    assert main([str(street_bag), *options, '--bag', '--T-base-sensor', mount]) == 0
    T_sensor_base = np.linalg.inv(parse_transform(mount, 'mount'))
    bases = [pose @ T_sensor_base for *_, pose in street]
    for found, base in zip(read_kitti(tmp_path / 'out/trajectory_kitti.txt'), bases, strict=True):
        assert errors(found, relative(bases[0], base))[0] < 0.15
    with AnyReader([tmp_path / 'out/bag']) as reader:
        found = [(connection.topic, reader.deserialize(raw, connection.msgtype))
                 for connection, _, raw in reader.messages()]
    odometry = [message for topic, message in found if topic == '/odometry']
    edges = [message for topic, message in found if topic == '/relative_pose']
    assert {message.child_frame_id for message in odometry} == {'base_link'}
    assert edges[0].header.frame_id == 'lidar@0'
    assert edges[0].child_frame_id == f'lidar@{PERIOD_NS}'
    assert errors(matrix_of(edges[0].pose.pose), relative(street[0][2], street[1][2]))[0] < 0.1


@pytest.fixture
def two_topics(street, tmp_path):
    points, labels, _ = street[0]
    with BagWriter(tmp_path / 'two') as bag:
        for topic, ids in (('/raw', None), ('/labelled', labels)):
            bag.write(topic, point_cloud2(bag.types, points, ids, 5, 'lidar'), 5)
    return tmp_path / 'two'


def test_the_labelled_topic_is_found(two_topics, tmp_path):
    assert main([str(two_topics), '--output', str(tmp_path / 'out')]) == 0
    assert summary(tmp_path / 'out')['topic'] == '/labelled'


@pytest.mark.parametrize(('options', 'says'), [
    (['--label-field', 'other'], 'several topics of clouds, choose one by --topic: /raw, /lab'),
    (['--topic', '/nope'], 'topic /nope: no clouds in .*; there are /raw, /labelled'),
    (['--sigma-g', '-1'], 'sigma_g = -1.0: below the minimum'),
    (['--mode', 'sideways'], "mode = 'sideways': not one of consecutive, keyframe"),
    (['--odom-frame', '/odom'], 'no leading slash'),
    (['--label-convention', 'klingon'], "label_convention = 'klingon'"),
])
def test_refusals(two_topics, tmp_path, capsys, options, says):
    assert main([str(two_topics), '--output', str(tmp_path / 'out'), *options]) == 2
    said = capsys.readouterr().err
    assert said.startswith('error: ')
    assert re.search(says, said), said
    assert not (tmp_path / 'out').exists()


def test_bag_without_clouds(tmp_path, capsys):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write('/chatter', header(bag.types, 5, 'map'), 5)
    assert main([str(tmp_path / 'bag')]) == 2
    assert 'no PointCloud2 in this bag; its topics are /chatter' in capsys.readouterr().err


def spoil(kind, street_bag, folder):
    """Return a path that is no good bag."""
    path = folder / 'bad'
    if kind == 'missing':
        return path
    if kind in ('text', 'text.mcap', 'text.db3', 'text.bag'):
        path = folder / kind
        path.write_text('this is no bag\n' * 100)
        return path
    if kind == 'folder':
        path.mkdir()
        return path
    shutil.copytree(street_bag, path)
    mcap = next(path.glob('*.mcap'))
    content = mcap.read_bytes()
    if kind == 'metadata':
        (path / 'metadata.yaml').write_text('nonsense: [')
    elif kind == 'truncated':
        mcap.write_bytes(content[:len(content) // 2])
    elif kind == 'empty':
        mcap.write_bytes(b'')
    elif kind == 'garbage':
        mcap.write_bytes(bytes(len(content)))
    else:
        mcap.unlink()
    return path


@pytest.mark.parametrize('kind', [
    'missing', 'text', 'text.mcap', 'text.db3', 'text.bag', 'folder', 'metadata', 'truncated',
    'empty', 'garbage', 'no storage'])
def test_corrupt_bags(street_bag, tmp_path, capsys, kind):
    path = spoil(kind, street_bag, tmp_path)
    assert main([str(path), '--output', str(tmp_path / 'out')]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'error: {path}: ')
    assert 'Traceback' not in said
    assert not (tmp_path / 'out').exists()
    tools = {'text.bag': 'rosbag reindex', 'text.mcap': 'mcap recover'}
    assert ('mends it' in said) is (kind in (
        'text.mcap', 'text.db3', 'text.bag', 'metadata', 'truncated', 'empty', 'garbage',
        'no storage'))
    assert 'mends it' not in said or tools.get(kind, 'ros2 bag reindex') in said


def test_a_bag_that_breaks_off_keeps_what_came_before(street, tmp_path, capsys):
    bag = write_raw(tmp_path / 'bag', [(i * PERIOD_NS, cdr(cloud_of(street, i, i * PERIOD_NS)))
                                       for i in (0, 1, 2, 3)])
    spoil_bytes(next(bag.glob('*.db3')), 0.6, 0.65)
    assert main([str(bag), '--output', str(tmp_path / 'out')]) == 2
    said = re.search(r'error: after (\d) scans: .*bag: cannot be read', capsys.readouterr().err)
    assert summary(tmp_path / 'out')['successes'] == int(said[1]) > 0
    assert len(read_kitti(tmp_path / 'out/trajectory_kitti.txt')) == int(said[1])


def test_clouds_that_are_gone_are_told(street_bag, tmp_path, capsys):
    bag = shutil.copytree(street_bag, tmp_path / 'bag')
    spoil_bytes(next(bag.glob('*.mcap')), 0.6, 0.9)
    assert main([str(bag), '--output', str(tmp_path / 'out')]) == 0
    assert re.search(r'the bag tells of 4 clouds, only \d came', capsys.readouterr().err)
    assert summary(tmp_path / 'out')['scans'] < 4


def spoil_bytes(path, begin, end):
    content = bytearray(path.read_bytes())
    part = slice(int(begin * len(content)), int(end * len(content)))
    content[part] = bytes(part.stop - part.start)
    path.write_bytes(content)


def test_other_kinds_of_bags(street, tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    cloud = cloud_of(street, 0, 7)
    one = tmp_path / 'one.bag'
    with Writer1(one) as bag:
        head = store.types['std_msgs/msg/Header'](
            seq=0, stamp=store.types['builtin_interfaces/msg/Time'](sec=0, nanosec=7),
            frame_id='lidar')
        field = store.types['sensor_msgs/msg/PointField']
        message = store.types[CLOUD](
            header=head, height=1, width=cloud.width, is_bigendian=False, is_dense=True,
            fields=[field(f.name, f.offset, f.datatype, f.count) for f in cloud.fields],
            point_step=cloud.point_step, row_step=cloud.row_step, data=cloud.data)
        connection = bag.add_connection('/points', CLOUD, typestore=store)
        bag.write(connection, 9, store.serialize_ros1(message, CLOUD))
    two = write_raw(tmp_path / 'two', [(9, cdr(cloud))])
    for path in (one, two, next(two.glob('*.db3'))):
        with BagReader(path) as bag:
            assert bag.find_topic('label') == '/points'
            (found,) = bag.clouds('/points')
            stamp_ns, frame, read = found.read()
            assert (found.bag_time_ns, stamp_ns, frame) == (9, 7, 'lidar')
            np.testing.assert_array_equal(np.asarray(read.data), cloud.data)


def test_real_sequence(data_folder, tmp_path):
    assert kitti_to_bag([str(data_folder / 'kitti/08'), str(tmp_path / 'bag')]) == 0
    assert main([str(tmp_path / 'bag'), '--output', str(tmp_path / 'out')]) == 0
    with AnyReader([tmp_path / 'bag']) as bag:
        truth = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages()
                 if c.topic == '/ground_truth']
    poses = read_kitti(tmp_path / 'out/trajectory_kitti.txt')
    p, q = truth[-1].pose.pose.position, truth[-1].pose.pose.orientation
    assert np.linalg.norm(poses[-1, :3, 3] - [p.x, p.y, p.z]) < 0.3
    turn = Rotation.from_matrix(poses[-1, :3, :3]).inv() * Rotation.from_quat([q.x, q.y, q.z, q.w])
    assert np.degrees(turn.magnitude()) < 1.0
    assert summary(tmp_path / 'out')['successes'] == 10
