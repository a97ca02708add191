"""A sequence on disk and the bag that comes of it hold the same scans, times and poses."""
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from sgor_ros import InputError
from sgor_ros.commands.kitti_to_bag import main
from sgor_ros.io.bags import BagReader
from sgor_ros.io.pointcloud2 import decode
from sgor_ros.io.trajectories import read_calibration
from sgor_ros.io.trajectories import read_kitti
from sgor_ros.io.trajectories import read_poses
from sgor_ros.io.trajectories import read_times
from sgor_ros.io.trajectories import write_kitti

NUMBERS = (3, 4, 6)


def rigid(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = q * np.sign(np.linalg.det(q)), rng.normal(0, 5, 3)
    return T


@pytest.fixture
def sequence(tmp_path):
    """Return a part of a sequence: scans 3, 4 and 6, times and poses of 0 to 9."""
    rng = np.random.default_rng(0)
    folder = tmp_path / '08'
    (folder / 'velodyne').mkdir(parents=True)
    for name in ('labels', 'predicted_labels'):
        (folder / name).mkdir()
    for number in NUMBERS:
        count = 100 + number
        rng.normal(0, 9, (count, 4)).astype(np.float32).tofile(
            folder / f'velodyne/{number:06d}.bin')
        np.full(count, number, np.uint32).tofile(folder / f'labels/{number:06d}.label')
        np.full(count, 50 + number, np.uint32).tofile(
            folder / f'predicted_labels/{number:06d}.label')
    (folder / 'times.txt').write_text(''.join(f'{i * 0.1039:.6e}\n' for i in range(10)))
    return folder


def clouds(path):
    with BagReader(path) as bag:
        return [(stamp_ns, frame, decode(message, 'label')) for stamp_ns, frame, message
                in (cloud.read() for cloud in bag.clouds('/points'))]


def test_clouds_labels_and_times(sequence, tmp_path, capsys):
    assert main([str(sequence), str(tmp_path / 'bag')]) == 0
    assert '3 clouds on /points, no poses' in capsys.readouterr().out
    result = clouds(tmp_path / 'bag')
    assert [stamp for stamp, _, _ in result] == [311_700_000, 415_600_000, 623_400_000]
    for number, (_, frame, scan) in zip(NUMBERS, result, strict=True):
        expected = np.fromfile(sequence / f'velodyne/{number:06d}.bin', np.float32)
        np.testing.assert_array_equal(scan.points, expected.reshape(-1, 4)[:, :3])
        assert set(scan.labels) == {number}
        assert frame == 'lidar'


def test_predicted_labels(sequence, tmp_path):
    assert main([str(sequence), str(tmp_path / 'bag'), '--labels', 'predicted_labels']) == 0
    assert [set(scan.labels) for *_, scan in clouds(tmp_path / 'bag')] == [{53}, {54}, {56}]


def test_ground_truth_is_of_the_lidar_and_begins_with_the_first_scan(sequence, tmp_path):
    rng = np.random.default_rng(1)
    T_camera_lidar = rigid(rng)
    T_world_lidar = [rigid(rng) for _ in range(10)]
    cameras = [T_camera_lidar @ T @ np.linalg.inv(T_camera_lidar) for T in T_world_lidar]
    np.savetxt(sequence / 'poses.txt', [T[:3].reshape(-1) for T in cameras])
    numbers = ' '.join(f'{v:.12e}' for v in T_camera_lidar[:3].reshape(-1))
    (sequence / 'calib.txt').write_text(f'P0: 1 2 3\n\nTr: {numbers}\n')
    assert main([str(sequence), str(tmp_path / 'bag')]) == 0
    with AnyReader([tmp_path / 'bag']) as bag:
        truth = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages()
                 if c.topic == '/ground_truth']
    assert len(truth) == len(NUMBERS)
    for number, message in zip(NUMBERS, truth, strict=True):
        expected = np.linalg.inv(T_world_lidar[3]) @ T_world_lidar[number]
        p = message.pose.pose.position
        np.testing.assert_allclose([p.x, p.y, p.z], expected[:3, 3], atol=1e-6)
        assert message.child_frame_id == 'lidar'


def broken(sequence, what):
    """Break one thing and return what the message must say."""
    if what == 'no folder':
        (sequence / 'velodyne').rename(sequence / 'elsewhere')
        return 'velodyne: no such folder'
    if what == 'no scans':
        for path in (sequence / 'velodyne').iterdir():
            path.unlink()
        return 'no .bin files'
    if what == 'labels missing':
        (sequence / 'labels/000004.label').unlink()
        return 'no labels for 1 of 3 scans, the first is 000004.label'
    if what == 'labels short':
        (sequence / 'labels/000004.label').write_bytes(b'1234')
        return '4 bytes are neither'
    if what == 'scan truncated':
        (sequence / 'velodyne/000006.bin').write_bytes(b'12345')
        return '5 bytes are no points'
    if what == 'times short':
        (sequence / 'times.txt').write_text('0\n1\n')
        return 'times.txt: 2 rows for 3 scans, which go up to number 6'
    if what == 'times missing':
        (sequence / 'times.txt').unlink()
        return 'times.txt: no such file'
    np.savetxt(sequence / 'poses.txt', np.tile(np.eye(4)[:3].reshape(-1), (10, 1)))
    return 'calib.txt: cannot be read'


@pytest.mark.parametrize('what', [
    'no folder', 'no scans', 'labels missing', 'labels short', 'scan truncated', 'times short',
    'times missing', 'no calibration'])
def test_broken_sequences(sequence, tmp_path, capsys, what):
    says = broken(sequence, what)
    assert main([str(sequence), str(tmp_path / 'bag')]) == 2
    message = capsys.readouterr().err
    assert message.startswith('error: ')
    assert says in message
    assert not (tmp_path / 'bag').exists()


EYE = '1 0 0 0 0 1 0 0 0 0 1 0'


@pytest.mark.parametrize(('times', 'says'), [
    ('0\n1\nnan\n3\n', 'time 2 is nan s'), ('0\n1e300\n', r'time 1 is 1e\+300 s'),
    ('-1\n1\n', 'time 0 is -1 s'), ('0 1 2\n3 4 5\n', 'expected one number a line, got 3'),
    ('0\n1\n0.5\n', 'time 2, 0.5 s, is not later'), ('0\n0\n', 'time 1, 0 s, is not later'),
    ('0\nzwei\n', 'cannot be read'), ('', 'it is empty')])
@pytest.mark.filterwarnings('error')
def test_times_are_times(tmp_path, times, says):
    (tmp_path / 'times.txt').write_text(times)
    with pytest.raises(InputError, match=rf'times\.txt: .*{says}'):
        read_times(tmp_path / 'times.txt')


@pytest.mark.parametrize(('row', 'says'), [
    ('nan ' * 12, 'the pose of scan 1 is not finite'),
    ('nan' + EYE[1:], 'the pose of scan 1 is not finite'),
    (EYE.replace('1', '0'), 'the pose of scan 1 is no rotation'),
    ('-' + EYE, 'the pose of scan 1 is no rotation'),
    (EYE.replace('0 0 0 0', '0 0 1e300 0'), 'the pose of scan 1 is no rotation'),
    (EYE + '\n1 2 3', 'cannot be read')])
def test_poses_are_poses(tmp_path, row, says):
    (tmp_path / 'poses.txt').write_text(f'{EYE}\n{row}\n')
    with pytest.raises(InputError, match=rf'poses\.txt: {says}'):
        read_poses(tmp_path / 'poses.txt')


def test_lines_without_a_pose_are_kept_where_they_may_be(tmp_path):
    write_kitti(tmp_path / 'poses.txt', [np.eye(4), None])
    assert np.isnan(read_kitti(tmp_path / 'poses.txt')[1, :3]).all()


@pytest.mark.parametrize(('row', 'says'), [
    ('Tr: ' + '0 ' * 12, 'Tr is no rotation and translation'),
    (f'Tr: {EYE} 0', 'Tr has 13 numbers'),
    ('P0: 1 2 3', 'no row Tr'), ('Tr: one two', 'cannot be read')])
def test_the_calibration_is_a_motion(tmp_path, row, says):
    (tmp_path / 'calib.txt').write_text(row + '\n')
    with pytest.raises(InputError, match=rf'calib\.txt: {says}'):
        read_calibration(tmp_path / 'calib.txt')


def test_an_existing_bag_is_not_overwritten(sequence, tmp_path, capsys):
    assert main([str(sequence), str(tmp_path)]) == 2
    assert 'exists already' in capsys.readouterr().err
