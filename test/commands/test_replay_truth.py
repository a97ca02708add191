"""`sgor_replay` beside the truth: from a file of TUM or KITTI, or as it comes with the data."""
import json

from conftest import PERIOD_NS
from conftest import relative
from conftest import write_bag
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import InputError
from sgor_ros.commands.replay import main
from sgor_ros.io.bags import BagWriter
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.messages import odometry_of
from sgor_ros.io.messages import point_cloud2
from sgor_ros.io.messages import transform_stamped
from sgor_ros.io.trajectories import read_kitti
from sgor_ros.io.trajectories import read_timed_poses
from sgor_ros.io.trajectories import write_kitti
from sgor_ros.io.trajectories import write_tum

T_MAP_WORLD = np.eye(4)
T_MAP_WORLD[:3, :3] = Rotation.from_euler('xyz', [0.1, -0.2, 2.0]).as_matrix()
T_MAP_WORLD[:3, 3] = 500.0, -200.0, 30.0


def summary(folder):
    return json.loads((folder / 'summary.json').read_text())


def by_hand(folder, street):
    """Return the RMSE of APE and RPE, metres, of a track laid on the truth at its start."""
    found = read_kitti(folder / 'trajectory_kitti.txt')
    true = np.array([relative(street[0][2], T) for *_, T in street])
    off = np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1)
    steps = [relative(relative(*found[i:i + 2]), relative(*true[i:i + 2]))[:3, 3]
             for i in range(len(true) - 1)]
    return np.sqrt(np.mean(off**2)), np.sqrt(np.mean(np.square(steps).sum(axis=1)))


@pytest.mark.parametrize('kind', ['tum', 'kitti'])
def test_truth_of_a_file_in_any_frame(street, street_bag, tmp_path, capsys, kind):
    poses = [T_MAP_WORLD @ T for *_, T in street]
    if kind == 'tum':    # of another program: more often, and a little off in time
        stamps = [i * PERIOD_NS + late for i in range(4) for late in (4_000_000, 50_000_000)]
        write_tum(tmp_path / 'truth', stamps, [T for pose in poses for T in (pose, np.eye(4))])
    else:
        write_kitti(tmp_path / 'truth', poses)
    out = tmp_path / 'out'
    assert main([str(street_bag), '--output', str(out), '--truth', str(tmp_path / 'truth')]) == 0
    error, = summary(out)['truth']
    ape, rpe = by_hand(out, street)
    assert 0 < ape < 0.15
    assert error['poses'] == 4
    assert error['ape_rmse_m'] == pytest.approx(ape, abs=1e-4)
    assert error['rpe_translation_rmse_m'] == pytest.approx(rpe, abs=1e-4)
    assert error['length_m'] == pytest.approx(4.5, abs=0.2)
    assert f'4 poses over {error["length_m"]:.1f} m: APE {error["ape_rmse_m"]:.3f} m' \
        in capsys.readouterr().out


def test_the_track_of_a_base_against_the_truth_of_its_sensor(street, street_bag, tmp_path):
    write_kitti(tmp_path / 'truth', [T for *_, T in street])
    mount = '1.2 -0.3 1.8 0.05 0.1 1.5'
    assert main([str(street_bag), '--output', str(tmp_path / 'out'), '--base-frame', 'base',
                 '--T-base-sensor', mount, '--truth', str(tmp_path / 'truth')]) == 0
    error, = summary(tmp_path / 'out')['truth']
    T_sensor_base = np.linalg.inv(parse_transform(mount, 'mount'))
    ape, _ = by_hand(tmp_path / 'out', [
        (None, None, T @ T_sensor_base) for *_, T in street])
    assert error['ape_rmse_m'] == pytest.approx(ape, abs=1e-4)
    assert ape < 0.2


def test_truth_that_comes_with_a_folder_and_some_of_it_missing(street, tmp_path):
    folder = tmp_path / 'drive'
    folder.mkdir()
    for i, (points, labels, _) in enumerate(street):
        np.savez(folder / f'{i}.npz', points=points, labels=labels)
    write_kitti(folder / 'poses.txt', [T for *_, T in street])
    assert main([str(folder), '--output', str(tmp_path / 'a')]) == 0
    assert summary(tmp_path / 'a')['truth'][0]['poses'] == 4
    write_kitti(tmp_path / 'part', [street[0][2], None, street[2][2], street[3][2]])
    assert main([str(folder), '--output', str(tmp_path / 'b'), '--truth',
                 str(tmp_path / 'part')]) == 0
    assert summary(tmp_path / 'b')['truth'][0]['poses'] == 3


def test_truth_that_does_not_fit_costs_no_results(street, tmp_path, capsys):
    bag = write_bag(tmp_path / 'bag', [(*scan[:2], i * PERIOD_NS) for i, scan in
                                       enumerate(street[:2])])
    write_kitti(tmp_path / 'kitti', [np.eye(4)] * 3)
    write_tum(tmp_path / 'tum', [10**18, 10**18 + PERIOD_NS], [np.eye(4)] * 2)
    for name, says in (('kitti', '3 poses for 2 scans'), ('tum', 'no pose within 0.02 s')):
        out = tmp_path / f'out_{name}'
        assert main([str(bag), '--output', str(out), '--truth', str(tmp_path / name)]) == 0
        assert says in capsys.readouterr().err
        assert summary(out)['truth'] == []
        assert summary(out)['successes'] == 2


@pytest.mark.parametrize(('text', 'says'), [
    ('', 'it is empty'), ('1 2 3\n', '3 numbers a line; expected 8'),
    ('0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n', 'line 2 of numbers is no later time'),
    ('0 0 0 0 0 0 0 0\n', 'line 1 of numbers is no later time with a pose'),
    ('0 nan 0 0 0 0 0 1\n', 'line 1'), ('1e99 0 0 0 0 0 0 1\n', 'line 1'),
    ('a b\n', 'cannot be read')])
def test_what_is_no_truth_is_told_before_the_work(street_bag, tmp_path, capsys, text, says):
    (tmp_path / 'truth').write_text(text)
    assert main([str(street_bag), '--output', str(tmp_path / 'out'), '--truth',
                 str(tmp_path / 'truth')]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_stamps_of_tum_are_exact(tmp_path):
    (tmp_path / 'a.tum').write_text('# stamp x y z\n1691936557.946849179 1 2 3 0 0 0 1\n')
    stamps_ns, poses = read_timed_poses(tmp_path / 'a.tum')
    assert stamps_ns.tolist() == [1691936557946849179]
    np.testing.assert_array_equal(poses[0, :3, 3], [1, 2, 3])
    with pytest.raises(InputError, match=r'no such|cannot be read'):
        read_timed_poses(tmp_path / 'nowhere')


def test_lines_end_where_numpy_ends_them(tmp_path):
    (tmp_path / 'a.tum').write_text('1.5 1 2\x0c3 0 0 0 1\n2.5 1 2 3 0 0 0 1\n')
    stamps_ns, poses = read_timed_poses(tmp_path / 'a.tum')
    assert stamps_ns.tolist() == [1_500_000_000, 2_500_000_000]
    assert len(poses) == 2


def pose_messages(types, kind, stamp_ns, T):
    """Return a message with a pose, of any of the types that serve as truth."""
    odometry = odometry_of(types, T, stamp_ns, 'map', 'lidar')
    if kind == 'Odometry':
        return odometry
    if kind == 'TransformStamped':
        return transform_stamped(types, T, stamp_ns, 'map', 'lidar')
    return types(f'geometry_msgs/msg/{kind}')(
        header=odometry.header,
        pose=odometry.pose if kind == 'PoseWithCovarianceStamped' else odometry.pose.pose)


@pytest.mark.parametrize('kind', ['Odometry', 'PoseStamped', 'PoseWithCovarianceStamped',
                                  'TransformStamped'])
def test_truth_on_a_topic_of_the_bag(street, tmp_path, kind, capsys):
    with BagWriter(tmp_path / 'bag') as bag:
        for i, (points, labels, T) in enumerate(street):
            stamp_ns = i * PERIOD_NS
            bag.write('/points', point_cloud2(bag.types, points, labels, stamp_ns, 'lidar'),
                      stamp_ns)
            # a little off in time, as of another computer; and more often
            for late, pose in ((4_000_000, T_MAP_WORLD @ T), (50_000_000, np.eye(4))):
                bag.write('/mocap/lidar', pose_messages(bag.types, kind, stamp_ns + late, pose),
                          stamp_ns + late)
    out = tmp_path / 'out'
    assert main([str(tmp_path / 'bag'), '-o', str(out), '--truth', '/mocap/lidar']) == 0
    error, = summary(out)['truth']
    ape, rpe = by_hand(out, street)
    assert (error['poses'], error['ape_rmse_m']) == (4, pytest.approx(ape, abs=1e-4))
    assert error['rpe_translation_rmse_m'] == pytest.approx(rpe, abs=1e-4)
    assert main([str(tmp_path / 'bag'), '-o', str(tmp_path / 'b'), '--truth', '/gps']) == 2
    assert 'topic /gps: no poses in' in (said := capsys.readouterr().err)
    assert 'there are /mocap/lidar' in said


@pytest.mark.parametrize(('change', 'says'), [
    ({'x': np.nan}, 'topic /truth: the pose at 0.000 s is not finite'), ({'w': 0.0}, 'norm')])
def test_poses_of_a_topic_that_are_none(street, tmp_path, capsys, change, says):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write('/points', point_cloud2(bag.types, *street[0][:2], 0, 'lidar'), 0)
        message = pose_messages(bag.types, 'PoseStamped', 0, np.eye(4))
        for name, value in change.items():
            setattr(message.pose.position if name == 'x' else message.pose.orientation, name,
                    value)
        bag.write('/truth', message, 0)
    assert main([str(tmp_path / 'bag'), '-o', str(tmp_path / 'out'), '--truth', '/truth']) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()
