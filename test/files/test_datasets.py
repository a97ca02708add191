"""Scans on disk: each layout is seen from its path, and broken ones are refused by name."""
import json
from pathlib import Path
import re
import shutil

from conftest import errors
from conftest import relative
from conftest import write_bag
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sgor_ros
from sgor_ros import InputError
from sgor_ros import open_drive
from sgor_ros import open_drives
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SgorConfig
from sgor_ros.commands.kitti_to_bag import main as kitti_to_bag
from sgor_ros.commands.replay import main as replay
from sgor_ros.core.scan.labels import label_convention
from sgor_ros.io.bags import BagReader
from sgor_ros.io.datasets.bags import BagSequence
from sgor_ros.io.datasets.mulran import T_BASE_SENSOR
from sgor_ros.io.trajectories import read_kitti
from sgor_ros.io.trajectories import write_kitti

STAMPS = [1691936557000000000 + i * 100_000_000 for i in range(4)]
T_VEHICLE_SENSOR = np.array([[0., -1, 0, 0.9], [1, 0, 0, 0.1], [0, 0, 1, 1.8], [0, 0, 0, 1]])


def write_bin(path, points, columns=4):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = np.ones((len(points), columns), np.float32)
    rows[:, :3] = points
    rows.tofile(path)


def write_labels(path, labels, dtype=np.uint32):
    path.parent.mkdir(parents=True, exist_ok=True)
    labels.astype(dtype).tofile(path)


def write_semantickitti(folder, street):
    for i, (points, labels, _) in enumerate(street):
        write_bin(folder / f'velodyne/{i:06d}.bin', points)
        write_labels(folder / f'labels/{i:06d}.label', labels)
    (folder / 'times.txt').write_text(''.join(f'{0.1 * i:.6e}\n' for i in range(len(street))))
    write_kitti(folder / 'poses.txt', [T for *_, T in street])
    return folder


def write_kitti_odometry(folder, street):
    """Write the download of KITTI: poses of a camera in a folder of their own, no labels."""
    T_camera_sensor = np.array([[0., -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])
    sequence = write_semantickitti(folder / 'sequences/03', street)
    shutil.rmtree(sequence / 'labels')
    (sequence / 'poses.txt').unlink()
    (folder / 'poses').mkdir()
    write_kitti(folder / 'poses/03.txt',
                [T_camera_sensor @ T @ np.linalg.inv(T_camera_sensor) for *_, T in street])
    numbers = ' '.join(map(str, T_camera_sensor[:3].ravel()))
    (sequence / 'calib.txt').write_text(f'Tr: {numbers}\n')
    return folder


def write_rellis(folder, street):
    for i, (points, labels, _) in enumerate(street):
        write_bin(folder / f'00000/os1_cloud_node_kitti_bin/{i:06d}.bin', points)
        write_labels(folder / f'00000/os1_cloud_node_semantickitti_label_id/{i:06d}.label', labels)
    write_kitti(folder / '00000/poses.txt', [T for *_, T in street])
    return folder


def write_nuscenes(folder, street):
    tables = folder / 'v1.0-mini'
    tables.mkdir(parents=True)
    content = {name: [] for name in ('sample', 'sample_data', 'ego_pose', 'lidarseg')}
    for i, (points, labels, T) in enumerate(street):
        vehicle = T @ np.linalg.inv(T_VEHICLE_SENSOR)
        files = {True: f'samples/LIDAR_TOP/s{9 - i}.pcd.bin',
                 False: f'sweeps/LIDAR_TOP/{i}.pcd.bin'}
        content['sample'].append({'token': f'sample{i}', 'scene_token': 'scene'})
        content['ego_pose'].append({'token': f'ego{i}', **of_nuscenes(vehicle)})
        for key, name in files.items():
            content['sample_data'].append({
                'token': f'data{i}{key}', 'sample_token': f'sample{i}',
                'ego_pose_token': f'ego{i}',
                'calibrated_sensor_token': 'mount', 'timestamp': 1532402927647951 + 500_000 * i,
                'filename': name})
            write_bin(folder / name, points if key else points[:5], 5)
        name = f'lidarseg/v1.0-mini/data{i}True_lidarseg.bin'
        write_labels(folder / name, labels % 32, np.uint8)
        content['lidarseg'].append({'token': f'l{i}', 'sample_data_token': f'data{i}True',
                                    'filename': name})
    content['scene'] = [{'token': 'scene', 'name': 'scene-0061'}]
    content['calibrated_sensor'] = [{'token': 'mount', **of_nuscenes(T_VEHICLE_SENSOR)}]
    for name, rows in content.items():
        # tables are in no order
        (tables / f'{name}.json').write_text(json.dumps(rows[::-1]))
    return folder


def of_nuscenes(T):
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
    return {'translation': T[:3, 3].tolist(), 'rotation': [w, x, y, z]}


def write_mulran(folder, street):
    """Write scans, and poses of the vehicle in UTM, ten times as often."""
    for stamp, (points, *_) in zip(STAMPS, street, strict=True):
        write_bin(folder / f'Ouster/{stamp}.bin', points)
    offset = np.eye(4)
    offset[:3, 3] = [353004.0, 4026250.0, 19.0]
    rows = []
    for stamp, (*_, T) in zip(STAMPS, street, strict=True):
        vehicle = offset @ T @ np.linalg.inv(T_BASE_SENSOR)
        rows += [','.join([str(stamp + late), *map(repr, vehicle[:3].ravel().tolist())])
                 for late in (7, 10_000_000, 20_000_000)]
    (folder / 'global_pose.csv').write_text('\n'.join(rows) + '\n')
    return folder


def write_helipr(folder, street, kind='Ouster', size=26, stamps=STAMPS):
    for stamp, (points, *_) in zip(stamps, street, strict=True):
        raw = np.full((len(points), size), 7, np.uint8)
        raw[:, :12] = points.astype('<f4').view(np.uint8)
        path = folder / f'LiDAR/{kind}/{stamp}.bin'
        path.parent.mkdir(parents=True, exist_ok=True)
        raw.tofile(path)
    truth = folder / f'LiDAR_GT/global_{kind}_gt.txt'
    truth.parent.mkdir(exist_ok=True)
    truth.write_text(''.join(
        ' '.join(map(repr, [int(stamp), *T[:3, 3].tolist(),
                            *Rotation.from_matrix(T[:3, :3]).as_quat().tolist()])) + '\n'
        for stamp, (*_, T) in zip(stamps, street, strict=True)))
    return folder


def write_scans(folder, street):
    """Write scans that are numbered without leading zeros, each of another kind."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, (points, labels, _) in enumerate(street):
        name = f'scan{8 + i}'
        if i % 2:
            np.savez(folder / f'{name}.npz', points=points, labels=labels)
        else:
            write_bin(folder / f'{name}.bin', points)
            write_labels(folder / f'{name}.label', labels)
    write_kitti(folder / 'poses.txt', [T for *_, T in street])
    return folder


WRITERS = {'semantickitti': write_semantickitti, 'kitti': write_kitti_odometry,
           'rellis': write_rellis, 'nuscenes': write_nuscenes, 'mulran': write_mulran,
           'helipr': write_helipr, 'scans': write_scans}
UNLABELLED = {'kitti', 'mulran', 'helipr'}
STAMPED = {'semantickitti', 'kitti', 'nuscenes', 'mulran', 'helipr'}


@pytest.mark.parametrize('layout', WRITERS)
def test_scans_labels_stamps_and_poses(street, tmp_path, layout):
    drive = open_drive(WRITERS[layout](tmp_path / 'data', street))
    assert len(drive) == len(street)
    for i, (points, labels, T) in enumerate(street):
        scan = drive.read(i)
        np.testing.assert_array_equal(scan.points, points)
        if layout in UNLABELLED:
            assert scan.labels is None
        else:
            np.testing.assert_array_equal(scan.labels,
                                          labels % 32 if layout == 'nuscenes' else labels)
        np.testing.assert_allclose(relative(*drive.T_world_sensor[[0, i]]),
                                   relative(street[0][2], T), atol=1e-6)
    assert (drive.stamps_ns is not None) == (layout in STAMPED)
    if layout in STAMPED:
        assert (np.diff(drive.stamps_ns) == (500_000_000 if layout == 'nuscenes'
                                             else 100_000_000)).all()
    assert drive.label_convention == {'nuscenes': 'nuscenes', 'rellis': 'rellis'}.get(
        layout, 'semantickitti')


def test_stamps_are_exact_to_the_nanosecond(street, tmp_path):
    drive = open_drive(write_helipr(tmp_path, street, stamps=[s + 1 for s in STAMPS]))
    assert drive.stamps_ns.tolist() == [s + 1 for s in STAMPS]


@pytest.mark.parametrize(('names', 'stamps'), [
    (['0.05', '0.1', '0.4', '10.25'], [50_000_000, 100_000_000, 400_000_000, 10_250_000_000]),
    (['0', '0.1', '0.15', '1e1'], [0, 100_000_000, 150_000_000, 10_000_000_000]),
    (['1691936557.946849179', '1691936558.0', '1691936558.05', '1691936558.1'],
     [1691936557946849179, 1691936558000000000, 1691936558050000000, 1691936558100000000]),
    (['1691936557_50000000', '1691936557_100000000', '1691936558_0', '1691936558_7'],
     [1691936557050000000, 1691936557100000000, 1691936558000000000, 1691936558000000007]),
    (['7-050000000', '7-100000000', '8-000000000', '11-000000000'],
     [7_050_000_000, 7_100_000_000, 8_000_000_000, 11_000_000_000]),
    (['1691936557000000', '1691936557050000', '1691936557100000', '1691936557150000'],
     [1691936557000000000 + i * 50_000_000 for i in range(4)]),
    (['1691936557000', '1691936557050', '1691936557100', '1691936557150'],
     [1691936557000000000 + i * 50_000_000 for i in range(4)]),
    (['0000000000000001', '0000000000000002', '0000000000000003', '0000000000000004'], None),
    (['scan2', 'scan10', 'scan11', 'scan100'], None), (['a_1', 'a_2', 'a_3', 'a_10'], None),
    (['1_1', '1_2', '1_10', '2_1'], None), (['v0.5', 'v0.25', 'v1.5', 'v10.5'], None)])
def test_scans_are_in_the_order_of_their_names_which_may_be_times(tmp_path, names, stamps):
    for i, name in enumerate(names):
        write_bin(tmp_path / f'{name}.bin', np.full((5, 3), 1.0 + i))
    drive = open_drive(tmp_path)
    if names[0] == 'v0.5':
        names = ['v0.25', 'v0.5', 'v1.5', 'v10.5']
    assert [scan.name.partition('/')[2] for scan in drive.scans] == names
    assert (None if drive.stamps_ns is None else drive.stamps_ns.tolist()) == stamps


def test_numbers_of_files_that_jump_are_a_warning(street, tmp_path, capsys):
    for number, (points, *_) in zip((126, 127, 530, 531), street, strict=True):
        write_bin(tmp_path / f'drive/{number:06d}.bin', points)
    drive = open_drive(tmp_path / 'drive')
    text, = drive.warnings
    assert 'jump from drive/000127 to drive/000530: some are missing' in text
    assert replay([str(tmp_path / 'drive'), '--output', str(tmp_path / 'out')]) == 0
    assert f'warning: {text}' in capsys.readouterr().err
    assert json.loads((tmp_path / 'out/summary.json').read_text())['warnings'][0] == text
    (tmp_path / 'drive/times.txt').write_text('0\n0.1\n0.2\n0.3\n')
    assert open_drive(tmp_path / 'drive').warnings == (), 'times tell'


def test_a_bag_and_what_it_was_made_of(street, tmp_path):
    folder = write_semantickitti(tmp_path / '08', street)
    T = np.eye(4)[:3].ravel()
    (folder / 'calib.txt').write_text('Tr: ' + ' '.join(map(str, T)))
    assert kitti_to_bag([str(folder), str(tmp_path / 'bag')]) == 0
    drive, bag = open_drive(folder), open_drive(tmp_path / 'bag')
    assert bag.stamps_ns.tolist() == drive.stamps_ns.tolist()
    for i in (2, 0):
        np.testing.assert_array_equal(bag.read(i).points, drive.read(i).points)
        np.testing.assert_array_equal(bag.read(i).labels, drive.read(i).labels)
    np.testing.assert_allclose(relative(*bag.T_world_sensor[[0, 3]]),
                               relative(*drive.T_world_sensor[[0, 3]]), atol=1e-6)
    with BagReader(tmp_path / 'bag') as reader:
        sequence = BagSequence(reader, '/points')
        np.testing.assert_array_equal(sequence.T_world_sensor, bag.T_world_sensor)


def test_clouds_of_a_bag_at_the_same_time_are_told_apart(street, tmp_path):
    bag = write_bag(tmp_path / 'bag', [(street[0][0], street[0][1], 5)])
    drive = open_drive(next(bag.glob('*.mcap')))
    assert (len(drive), drive.stamps_ns.tolist(), drive.T_world_sensor) == (1, [5], None)


@pytest.mark.parametrize('layout', ['kitti', 'nuscenes', 'scans'])
def test_a_folder_is_replayed_as_its_bag(street, tmp_path, layout):
    """The poses are right, and the labels are read in the convention of the layout."""
    folder = WRITERS[layout](tmp_path / 'data', street)
    assert replay([str(folder), '--output', str(tmp_path / 'out')]) == 0
    summary = json.loads((tmp_path / 'out/summary.json').read_text())
    assert summary['successes'] == len(street)
    assert summary['parameters']['label_convention'] == open_drive(folder).label_convention
    poses = read_kitti(tmp_path / 'out/trajectory_kitti.txt')
    for found, (*_, T) in zip(poses, street, strict=True):
        metres, degrees = errors(found, relative(street[0][2], T))
        assert metres < 0.2
        assert degrees < 0.5


def test_one_of_several_drives_is_chosen_by_name(street, tmp_path, capsys):
    for name in ('sequences/00', 'sequences/01'):
        write_semantickitti(tmp_path / name, street[:2])
    assert [drive.name for drive in open_drives(tmp_path)] == ['sequences/00', 'sequences/01']
    with pytest.raises(InputError, match='several drives, choose one; there are sequences/00, '):
        open_drive(tmp_path)
    with pytest.raises(InputError, match='no drive 02; there are sequences/00'):
        open_drive(tmp_path, '02')
    assert open_drive(tmp_path, '01').name == open_drive(
        tmp_path, 'sequences/01').name == 'sequences/01'
    assert replay([str(tmp_path), '--output', str(tmp_path / 'out')]) == 2
    assert 'several drives' in capsys.readouterr().err
    assert replay([str(tmp_path), '--sequence', '01', '--output', str(tmp_path / 'out')]) == 0


def test_each_lidar_of_helipr(street, tmp_path):
    sizes = {'Ouster': 26, 'Velodyne': 22, 'Avia': 19, 'Aeva': 29}
    later = [stamp + 10**15 for stamp in STAMPS]
    for kind, size in sizes.items():
        write_helipr(tmp_path, street, kind, size, later)
    drives = {drive.name.rpartition('/')[2]: drive for drive in open_drives(tmp_path)}
    assert drives.keys() == sizes.keys()
    for drive in drives.values():
        np.testing.assert_array_equal(drive.read(1).points, street[1][0])
    one = open_drive(tmp_path / 'LiDAR/Avia')
    np.testing.assert_array_equal(one.read(3).points, street[3][0])
    assert one.T_world_sensor is not None


def test_scans_of_helipr_may_be_links(street, tmp_path):
    write_helipr(tmp_path / 'disk', street, 'Avia', 19)
    kept = tmp_path / 'here/LiDAR/Avia'
    kept.mkdir(parents=True)
    for i, scan in enumerate(sorted((tmp_path / 'disk/LiDAR/Avia').iterdir())):
        scan.rename(tmp_path / f'disk/{i}.raw')
        (kept / scan.name).symlink_to(tmp_path / f'disk/{i}.raw')
    np.testing.assert_array_equal(open_drive(kept).read(2).points, street[2][0])


def test_early_scans_of_the_aeva_are_shorter(street, tmp_path):
    drive = open_drive(write_helipr(tmp_path, street, 'Aeva', 25))
    np.testing.assert_array_equal(drive.read(0).points, street[0][0])


def test_the_interface_exports_it():
    assert {'Drive', 'open_drive', 'open_drives'} <= set(sgor_ros.__all__)


def spoil(folder, street, what):
    """Break one thing of a good folder; return what the message must say."""
    kitti = folder / '08'
    if what not in ('mulran poses', 'helipr poses', 'nuscenes table', 'nuscenes scans', 'empty'):
        write_semantickitti(kitti, street)
    match what:
        case 'poses short':
            write_kitti(kitti / 'poses.txt', [np.eye(4)] * 3)
            return kitti, 'poses.txt: 3 rows for 4 scans, which go up to number 3'
        case 'poses nan':
            write_kitti(kitti / 'poses.txt', [np.eye(4), None, np.eye(4), np.eye(4)])
            return kitti, 'poses.txt: the pose of scan 1 is no rotation and translation'
        case 'times fall back':
            (kitti / 'times.txt').write_text('0\n0.1\n0.05\n0.3\n')
            return kitti, 'times.txt: time 2, .* is not later than the one before'
        case 'times nan':
            (kitti / 'times.txt').write_text('0\nnan\n0.2\n0.3\n')
            return kitti, 'times.txt: time 1 is nan s'
        case 'times huge':
            (kitti / 'times.txt').write_text('0\n0.1\n0.2\n1e300\n')
            return kitti, r'times.txt: time 3 is 1e\+300 s'
        case 'times of columns':
            (kitti / 'times.txt').write_text('0 1 2\n' * 4)
            return kitti, 'times.txt: expected one number a line'
        case 'calibration zero':
            (kitti / 'calib.txt').write_text('Tr: ' + '0 ' * 12)
            return kitti, 'calib.txt: the pose of scan 0|calib.txt: .* no rotation'
        case 'no scans':
            shutil.rmtree(kitti / 'velodyne')
            (kitti / 'velodyne').mkdir()
            return kitti, 'velodyne: no .bin files'
        case 'mulran poses':
            folder = write_mulran(kitti, street)
            rows = (folder / 'global_pose.csv').read_text().splitlines()
            (folder / 'global_pose.csv').write_text('\n'.join(rows[:6]))
            return kitti, rf'global_pose.csv: no pose within 0.1 s of scan {STAMPS[3]}'
        case 'helipr poses':
            write_helipr(kitti, street)
            truth = kitti / 'LiDAR_GT/global_Ouster_gt.txt'
            truth.write_text(''.join(truth.read_text().splitlines(keepends=True)[:-1]))
            return kitti, f'no pose for 1 of 4 scans, the first is {STAMPS[3]}'
        case 'nuscenes table':
            write_nuscenes(kitti, street)
            (kitti / 'v1.0-mini/ego_pose.json').write_text('[{}]')
            return kitti, 'ego_pose.json: no table of nuScenes'
        case 'nuscenes scans':
            write_nuscenes(kitti, street)
            shutil.rmtree(kitti / 'samples')
            return kitti, 'none of the scans that the tables tell of is here'
        case 'empty':
            kitti.mkdir()
            return kitti, 'no folder velodyne in it'
        case 'missing':
            return folder / '09', '09: no such file or folder'
        case _:
            return kitti / 'poses.txt', 'poses.txt: neither a bag nor a folder'


@pytest.mark.parametrize('what', [
    'poses short', 'poses nan', 'times fall back', 'times nan', 'times huge', 'times of columns',
    'calibration zero', 'no scans', 'mulran poses', 'helipr poses', 'nuscenes table',
    'nuscenes scans', 'empty', 'missing', 'a file'])
def test_what_is_broken_is_named(street, tmp_path, what):
    small = [(points[:50], labels[:50], T) for points, labels, T in street]
    path, says = spoil(tmp_path, small, what)
    with pytest.raises(InputError, match=says):
        open_drive(path)


@pytest.mark.parametrize('layout', ['semantickitti', 'scans'])
@pytest.mark.parametrize('where', ['beside', 'elsewhere'])
def test_a_folder_of_labels_by_name(street, tmp_path, monkeypatch, layout, where):
    folder = WRITERS[layout](tmp_path / 'data', street)
    scans = [scan.name.rpartition('/')[2] for scan in open_drive(folder).scans]
    monkeypatch.chdir(tmp_path)
    chosen = folder / 'net' if where == 'beside' else tmp_path / 'net'
    chosen.mkdir()
    for name, (_, labels, _) in zip(scans, street, strict=True):
        write_labels(chosen / f'{name}.label', labels // 2)
    drive = open_drive(folder, labels='net')
    for index, (_, labels, _) in enumerate(street):
        np.testing.assert_array_equal(drive.read(index).labels, labels // 2)
    (chosen / f'{scans[2]}.label').unlink()
    with pytest.raises(InputError, match=f'no labels for 1 of 4 scans, the first is {scans[2]}'):
        open_drive(folder, labels='net')
    with pytest.raises(InputError, match='nowhere: no such folder'):
        open_drive(folder, labels='nowhere')


def test_a_layout_with_labels_of_its_own_takes_no_other_folder(street, street_bag, tmp_path):
    folder = WRITERS['rellis'](tmp_path / 'data', street)
    with pytest.raises(InputError, match=r'labels net: .* has its own, in the layout of rellis'):
        open_drive(folder, labels='net')
    with pytest.raises(InputError, match='labels net: the clouds of a bag'):
        open_drive(street_bag, labels='net')


def test_labels_of_two_conventions_are_no_one_convention(data_folder):
    with pytest.raises(InputError, match=r'several conventions .semantickitti, semantickitti_tr'):
        _ = open_drive(data_folder / 'kitti/00').label_convention


@pytest.mark.parametrize(('path', 'count', 'pair'), [
    ('kitti/08', 10, (4, 0)), ('nuscenes', 20, (3, 2)), ('../drives/kitti_08b', 61, (20, 12)),
    ('../drives/courtyard', 20, (9, 7))])
def test_poses_of_real_drives_lead_from_scan_to_scan(data_folder, path, count, pair):
    """The truth, and not its inverse, is what registering two of the scans finds."""
    if not (data_folder / path).is_dir():
        pytest.skip(f'no {path}')
    drive = open_drive(data_folder / path)
    assert len(drive) == len(drive.T_world_sensor) == count
    config = SgorConfig(label_convention=drive.label_convention)
    source, target = (preprocess(drive.read(i), config) for i in pair)
    result = register(source, target, config)
    truth = relative(drive.T_world_sensor[pair[1]], drive.T_world_sensor[pair[0]])
    assert result.success, result.reason
    error = relative(truth, result.T_target_source)
    assert np.linalg.norm(error[:2, 3]) < 0.3
    assert errors(result.T_target_source, truth)[1] < 1.0
    assert errors(result.T_target_source, np.linalg.inv(truth))[0] > 1.0


@pytest.mark.parametrize(('path', 'sizes'), [
    ('ouster', [131072]), ('livox', [40000, 40000]), ('bags/watercan.bag', [13966])])
def test_real_scans_without_poses(data_folder, path, sizes):
    drive = open_drive(data_folder / path)
    assert drive.T_world_sensor is None
    for i, size in enumerate(sizes):
        assert len(drive.read(i)) == pytest.approx(size, rel=0.1)


def test_real_labels_of_rellis_are_all_known(data_folder):
    labels = open_drive(data_folder / 'ouster').read(0).labels
    classes, _, unknown = label_convention('rellis').decode(labels)
    assert unknown == []
    assert (classes > 0).sum() > 60000


def test_the_example_of_the_docs(street, tmp_path, capsys):
    page = (Path(__file__).resolve().parents[2] / 'docs/data.md').read_text()
    code, = re.findall(r'```python\n(.*?)```', page, re.DOTALL)
    scope = {'path': write_scans(tmp_path / 'park', street[:2])}
    exec(code, scope)
    assert capsys.readouterr().out == 'park 2 semantickitti\n'
    assert scope['tracked'].success
    metres, _ = errors(scope['tracked'].T_odom_sensor, relative(street[0][2], scope['truth'][-1]))
    assert metres < 0.1
