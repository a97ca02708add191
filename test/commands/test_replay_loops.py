"""`sgor_replay --loops`: what it writes, read by others."""
import json

from conftest import errors
from conftest import relative
import numpy as np
import open3d
import pytest
from return_drive import return_drive
from return_drive import THERE
from rosbags.highlevel import AnyReader

from sgor_ros.commands.replay import main
from sgor_ros.core.common import se3
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.scans import read_scan
from sgor_ros.io.trajectories import read_kitti
from sgor_ros.io.trajectories import write_kitti

gtsam = pytest.importorskip('gtsam')

MOUNT = '1.2 -0.3 1.8 0.05 0.1 1.5'
PERIOD_NS = 100_000_000


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Return a folder of scans with their poses, there and back."""
    folder = tmp_path_factory.mktemp('drive') / 'street'
    for name in ('velodyne', 'labels'):
        (folder / name).mkdir(parents=True)
    for i, (points, labels, _) in enumerate(return_drive()):
        np.column_stack((points, np.ones(len(points)))).astype(np.float32).tofile(
            folder / f'velodyne/{i:06d}.bin')
        labels.astype(np.uint32).tofile(folder / f'labels/{i:06d}.label')
    write_kitti(folder / 'poses.txt', [T for *_, T in return_drive()])
    return folder


@pytest.fixture(scope='module')
def replayed(recorded):
    output = recorded.parent / 'replayed'
    assert main([str(recorded), '--loops', '--bag', '--output', str(output), '--base-frame',
                 'base_link', '--T-base-sensor', MOUNT]) == 0
    return output


def told(folder):
    return json.loads((folder / 'summary.json').read_text())['map']


def test_the_corrected_trajectory_is_that_of_the_base(replayed):
    T_base_sensor = parse_transform(MOUNT, 'mount')
    base = [T @ se3.inverse(T_base_sensor) for *_, T in return_drive()]
    poses = read_kitti(replayed / 'corrected_kitti.txt')
    assert len(poses) == len(base)
    for T, true in zip(poses, base, strict=True):
        assert errors(T, relative(base[0], true))[0] < 0.15
    tum = np.loadtxt(replayed / 'corrected.tum')
    np.testing.assert_allclose(tum[:, 1:4], poses[:, :3, 3], atol=1e-6)
    assert not (replayed / 'corrected_2.tum').exists()


def test_the_summary_counts_and_knows_the_error(replayed):
    summary = told(replayed)
    assert len(summary['loops']) > 8
    assert all(target < source for target, source in summary['loops'])
    assert summary['parts'] == 1
    assert 0 < summary['keyframes'] < summary['nodes']
    assert 0 < summary['ape_after_m'] < 0.1
    assert 0 < summary['ape_before_m'] < 0.2
    assert 0 < summary['chi_squared_per_degree_of_freedom'] < 2


def test_the_graph_is_read_by_gtsam_and_its_nodes_have_stamps(replayed):
    factors, values = gtsam.readG2o(str(replayed / 'graph.g2o'), True)
    summary = told(replayed)
    assert values.size() == summary['nodes']
    assert factors.size() == summary['nodes'] - 1 + len(summary['loops'])
    stamps = dict(np.loadtxt(replayed / 'graph_stamps.txt', np.int64).tolist())
    assert set(stamps) == set(values.keys())
    for node, stamp_ns in stamps.items():
        index = stamp_ns // PERIOD_NS - min(stamps.values()) // PERIOD_NS
        true = relative(return_drive()[0][2], return_drive()[index][2])
        assert errors(values.atPose3(node).matrix(), true)[0] < 0.15


def test_the_map_is_read_by_others_and_lies_on_the_scans(replayed):
    clouds = [open3d.io.read_point_cloud(str(replayed / f'map.{ending}'))
              for ending in ('ply', 'pcd')]
    ply, pcd = (np.asarray(cloud.points) for cloud in clouds)
    np.testing.assert_allclose(ply, pcd, atol=1e-6)
    np.testing.assert_allclose(np.asarray(clouds[0].colors), np.asarray(clouds[1].colors),
                               atol=1e-6)
    assert len(np.unique(np.asarray(clouds[0].colors), axis=0)) > 4
    assert len(read_scan(replayed / 'map.ply')) == len(ply) > 10000
    # what another scan sees is in it
    first, seen = return_drive()[0][2], return_drive()[THERE // 2]
    points = se3.transform(relative(first, seen[2]), seen[0][::10].astype(np.float64))
    near = points[np.linalg.norm(points - relative(first, seen[2])[:3, 3], axis=1) < 15]
    distance = clouds[0].__class__(open3d.utility.Vector3dVector(near)
                                   ).compute_point_cloud_distance(clouds[0])
    assert np.median(distance) < 0.3


def test_the_bag_has_the_loops(replayed):
    with AnyReader([replayed / 'bag']) as bag:
        topics = {connection.topic: connection.msgcount for connection in bag.connections}
    assert topics['/loop_closure'] > 0
    assert not {'/path', '/map_cloud', '/tf'} & set(topics)
    assert (replayed / 'loops.png').stat().st_size > 20000


def test_without_the_option_there_is_no_map(recorded, tmp_path):
    assert main([str(recorded), '--output', str(tmp_path / 'out')]) == 0
    assert not list((tmp_path / 'out').glob('graph*'))
    assert 'map' not in json.loads((tmp_path / 'out/summary.json').read_text())
