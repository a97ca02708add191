"""`sgor_map`: a drive becomes a map, scans are found in it, two become one; others read it."""
import json
import subprocess
import sys

from conftest import errors
from conftest import relative
import numpy as np
import open3d
from PIL import Image
import pytest
from return_drive import PERIOD_NS
from return_drive import return_drive
from return_drive import THERE
from return_drive import TURN
from scipy.spatial import cKDTree
import yaml

from sgor_ros import Map
from sgor_ros.commands.map import main
from sgor_ros.core.common import se3
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.trajectories import write_kitti
from sgor_ros.mapping.edge import Kind

pytest.importorskip('gtsam')

BACK = THERE + TURN


def recorded(folder, indexes):
    """Write scans of the drive as a folder in the layout of KITTI."""
    for name in ('velodyne', 'labels'):
        (folder / name).mkdir(parents=True)
    for i, index in enumerate(indexes):
        points, labels, _ = return_drive()[index]
        np.column_stack((points, np.ones(len(points)))).astype(np.float32).tofile(
            folder / f'velodyne/{i:06d}.bin')
        labels.astype(np.uint32).tofile(folder / f'labels/{i:06d}.label')
    write_kitti(folder / 'poses.txt', [return_drive()[index][2] for index in indexes])
    return folder


@pytest.fixture(scope='module')
def work(tmp_path_factory):
    """Return a folder with two drives and the maps of both."""
    folder = tmp_path_factory.mktemp('work')
    for name, indexes in (('there', range(THERE)), ('back', range(BACK, len(return_drive())))):
        recorded(folder / name, indexes)
        assert main(['build', str(folder / name), '--output', str(folder / f'map_{name}')]) == 0
    return folder


def truth(index):
    return relative(return_drive()[0][2], return_drive()[index][2])


def index_of(node, known):
    """Return which scan of the drive a node is; folders begin each at their own time."""
    first = min(its.stamp_ns for its in known.nodes.values() if its.session == node.session)
    return round((node.stamp_ns - first) / PERIOD_NS) + (BACK if node.session else 0)


def test_build_writes_a_map_with_its_settings(work, capsys):
    known = Map.load(work / 'map_there')
    assert len(known.keyframes) >= 6
    for node in known.nodes.values():
        assert errors(node.T_map_sensor, truth(index_of(node, known)))[0] < 0.1
    assert main(['show', str(work / 'map_there')]) == 0
    said = capsys.readouterr().out
    assert f'{len(known.nodes)} nodes and {len(known.keyframes)} keyframes' in said
    assert 'session 0' in said


def test_locate_tells_the_pose(work, tmp_path, capsys):
    scan, labels = (str(work / 'back' / name) for name in (
        'velodyne/000007.bin', 'labels/000007.label'))
    code = main(['locate', str(work / 'map_there'), scan, '--labels', labels, '--json',
                 str(tmp_path / 'found.json')])
    assert code == 0
    assert 'T_map_sensor' in capsys.readouterr().out
    told = json.loads((tmp_path / 'found.json').read_text())
    assert told['success']
    assert errors(np.array(told['T_map_sensor']), truth(BACK + 7))[0] < 0.1
    assert np.shape(told['covariance']) == (6, 6)
    assert main(['locate', str(work / 'map_there'), scan, '--labels', labels, '--json', '-']) == 0
    said = capsys.readouterr()
    assert json.loads(said.out) == told    # for a pipe: words are on standard error
    assert 'T_map_sensor' in said.err


def test_what_is_not_there_is_code_one(work, elsewhere, tmp_path, capsys):
    np.savez(tmp_path / 'elsewhere.npz', points=elsewhere[0][0])
    assert main(['locate', str(work / 'map_there'), str(tmp_path / 'elsewhere.npz')]) == 1
    assert 'not found, refused' in capsys.readouterr().out


def test_merge_makes_one_and_refuses_settings_that_differ(work, capsys):
    one, two, both = (str(work / f'map_{name}') for name in ('there', 'back', 'both'))
    assert main(['merge', one, two, '--output', both]) == 0
    assert 'a map of 2 drives' in capsys.readouterr().out
    joined = Map.load(both)
    for node in joined.nodes.values():
        assert errors(node.T_map_sensor, truth(index_of(node, joined)))[0] < 0.1
    assert main(['build', str(work / 'there'), '--output', str(work / 'coarse'),
                 '--voxel-size', '0.4']) == 0
    assert main(['merge', one, str(work / 'coarse'), '--output', both]) == 2
    assert 'voxel_size' in capsys.readouterr().err
    assert len(Map.load(both).nodes) == len(joined.nodes)    # as it was


def test_build_goes_on_in_a_map(work, tmp_path):
    before, output = work / 'map_there', tmp_path / 'both'
    assert main(['build', str(work / 'back'), '--map', str(before), '--output',
                 str(output)]) == 0
    known = Map.load(output)
    assert known.sessions == (0, 1)
    for node in known.nodes.values():
        assert errors(node.T_map_sensor, truth(index_of(node, known)))[0] < 0.1


def test_clouds_are_read_by_others(work, tmp_path):
    clouds = []
    for ending in ('ply', 'pcd'):
        assert main(['export', str(work / 'map_there'), str(tmp_path / f'map.{ending}')]) == 0
        clouds.append(open3d.io.read_point_cloud(str(tmp_path / f'map.{ending}')))
    ply, pcd = (np.asarray(cloud.points) for cloud in clouds)
    np.testing.assert_allclose(ply, pcd, atol=1e-6)
    assert len(ply) > 10000


def test_the_grid_is_what_map_server_reads(work, tmp_path):
    """Read by Pillow and PyYAML; walls are occupied, the way that was driven is free."""
    assert main(['export', str(work / 'map_there'), str(tmp_path / 'yard.yaml'),
                 '--resolution', '0.2']) == 0
    about = yaml.safe_load((tmp_path / 'yard.yaml').read_text())
    assert about['mode'] == 'trinary'
    assert 0 < about['free_thresh'] < about['occupied_thresh'] < 1
    image = np.asarray(Image.open(tmp_path / about['image']))
    # map_server: darker is occupied, the first row of the picture is the greatest y
    share = (255 - image[::-1].astype(float)) / 255
    occupied = share > about['occupied_thresh']
    free = share < about['free_thresh']

    def cell(xy):
        column, row = np.floor((xy - about['origin'][:2]) / about['resolution']).astype(int).T
        return row, column

    way = np.array([truth(i)[:2, 3] for i in range(THERE)])
    assert free[cell(way)].mean() > 0.9
    assert not occupied[cell(way)].any()
    # what stands at the height of a robot in another scan
    points, _, T = return_drive()[THERE // 2]
    up = points[:, 2] + 1.73
    near = points[(up > 0.6) & (up < 1.6) & (np.linalg.norm(points, axis=1) < 12)]
    placed = se3.transform(relative(return_drive()[0][2], T), near.astype(np.float64))
    assert occupied[cell(placed[:, :2])].mean() > 0.6
    assert (~free & ~occupied).mean() > 0.1
    assert occupied.mean() < 0.2


def test_show_draws_the_map_and_where_a_scan_was_found(work, tmp_path):
    assert main(['show', str(work / 'map_there'), '--output', str(tmp_path / 'map.png'), '--scan',
                 str(work / 'back/velodyne/000010.bin')]) == 0
    image = np.asarray(Image.open(tmp_path / 'map.png').convert('RGB'))
    assert image.shape[0] > 500
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 50


@pytest.mark.parametrize('labels', [True, False])
def test_show_into_rerun_holds_cloud_keyframes_edges_and_the_place(work, tmp_path, labels):
    pytest.importorskip('rerun', reason='the extra visualize is not installed')
    from test_visualize import component
    from test_visualize import entities
    both = work / 'map_merged'
    if not both.exists():
        Map.load(work / 'map_there').merge(Map.load(work / 'map_back')).map.save(both)
    known = Map.load(both)
    named = ['--labels', str(work / 'back/labels/000010.label')] if labels else []
    assert main(['show', str(both), '--visualize', str(tmp_path / 'map.rrd'), '--scan',
                 str(work / 'back/velodyne/000010.bin'), *named]) == 0
    found = entities(tmp_path / 'map.rrd')
    assert len(component(found['/map/cloud'], ':positions')[0]) > 10000
    keyframes, = component(found['/map/keyframes'], ':positions')
    np.testing.assert_allclose(keyframes, known.positions[1], atol=1e-4)
    for kind in Kind:
        ends, = component(found[f'/map/edges/{kind.value}'], ':strips')
        expected = [known.poses((edge.target, edge.source))[:, :3, 3] for edge in known.edges
                    if edge.kind is kind]
        assert len(expected) >= 4
        np.testing.assert_allclose(ends, expected, atol=1e-4)
    at, = component(found['/map/scan/found/0'], 'translation')
    assert np.linalg.norm(at[0] - truth(BACK + 10)[:3, 3]) < 0.1


def test_merge_over_processes_gives_the_same_map(work, tmp_path, capsys):
    one, two = str(work / 'map_there'), str(work / 'map_back')
    assert main(['merge', one, two, '--output', str(tmp_path / 'here')]) == 0
    assert main(['merge', one, two, '--output', str(tmp_path / 'there'), '--processes', '2']) == 0
    for name in ('graph.npz', 'keyframes.npz'):
        assert (tmp_path / 'here' / name).read_bytes() == (tmp_path / 'there' / name).read_bytes()
    capsys.readouterr()
    for option, said in ((('--dask', 'tcp://127.0.0.1:1'), 'no scheduler there'),
                         (('--processes', '0'), '--processes 0: expected 1 or more')):
        assert main(['merge', one, two, '--output', str(tmp_path / 'none'), *option]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / 'none').exists()


def test_a_tilted_sensor_gives_an_upright_grid_and_cloud(work, tmp_path):
    """It looks down by 20 degrees: the same street, seen from its base, has the same ground."""
    tilt = parse_transform('0.5 0 1.73 0 0.35 0', 'mount')
    untilt = np.linalg.inv(tilt)
    for name in ('velodyne', 'labels'):
        (tmp_path / 'tilted' / name).mkdir(parents=True)
    for i in range(THERE):
        points, labels, _ = return_drive()[i]
        # the sensor of the drive is 1.73 m over the ground, where this base has its origin
        seen = se3.transform(untilt @ parse_transform('0.5 0 1.73 0 0 0', 'up'),
                             points.astype(np.float64))
        np.column_stack((seen, np.ones(len(seen)))).astype(np.float32).tofile(
            tmp_path / f'tilted/velodyne/{i:06d}.bin')
        labels.astype(np.uint32).tofile(tmp_path / f'tilted/labels/{i:06d}.label')
    assert main(['build', str(tmp_path / 'tilted'), '--output', str(tmp_path / 'map'),
                 '--base-frame', 'base_link', '--T-base-sensor', '0.5 0 1.73 0 0.35 0']) == 0
    np.testing.assert_allclose(Map.load(tmp_path / 'map').T_base_sensor, tilt)
    assert main(['export', str(tmp_path / 'map'), str(tmp_path / 'map.ply')]) == 0
    assert main(['export', str(work / 'map_there'), str(tmp_path / 'level.ply')]) == 0
    tilted, level = (np.asarray(open3d.io.read_point_cloud(str(tmp_path / name)).points)
                     for name in ('map.ply', 'level.ply'))
    # by clouds: the one that was mounted lies where the other does, and the base on the ground
    expected = level + [0.5, 0, 1.73]
    near = cKDTree(expected).query(tilted)[0]
    assert np.percentile(near, 90) < 0.4
    ground = tilted[np.linalg.norm(tilted[:, :2], axis=1) < 10, 2]
    assert np.percentile(ground, 10) == pytest.approx(0, abs=0.15)
    assert main(['export', str(tmp_path / 'map'), str(tmp_path / 'map.yaml'),
                 '--resolution', '0.2']) == 0
    about = yaml.safe_load((tmp_path / 'map.yaml').read_text())
    image = np.asarray(Image.open(tmp_path / about['image']))[::-1].astype(float)
    way = np.array([truth(i)[:2, 3] for i in range(THERE)]) + [0.5, 0]
    column, row = np.floor((way - about['origin'][:2]) / about['resolution']).astype(int).T
    assert ((255 - image[row, column]) / 255 < about['free_thresh']).mean() > 0.9


@pytest.mark.parametrize(('arguments', 'said'), [
    (('show', '{}/none'), 'no such folder'), (('show', '{}/there'), 'no map'),
    (('export', '{}/map_there', '{}/a.txt'), '.ply, .pcd, .yaml'),
    (('export', '{}/map_there', '{}/a.yaml', '--resolution', '0'), 'resolution = 0.0'),
    (('locate', '{}/map_there', '{}/none.bin'), 'none.bin'),
    (('build', '{}/back', '--map', '{}/map_there', '--voxel-size', '0.4', '--output', '{}/b'),
     'voxel_size = 0.4')])
def test_what_cannot_be_done_is_said_in_a_line(work, capsys, arguments, said):
    assert main([text.format(work) for text in arguments]) == 2
    line, = capsys.readouterr().err.splitlines()
    assert said in line


def test_it_runs_as_a_process(work):
    done = subprocess.run([sys.executable, '-m', 'sgor_ros.commands.map', 'show',
                           str(work / 'map_there')], capture_output=True, text=True, check=True)
    assert 'keyframes' in done.stdout
