"""Columns, normals of the nearest ten, and GICP on them against small_gicp's."""
from dataclasses import replace

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from sgor_ros import SgorConfig
from sgor_ros.core.execution.threads import cores
from sgor_ros.core.icp.gicp import align
from sgor_ros.core.index.columns import in_columns
from sgor_ros.core.index.columns import MOST_COLUMNS
from sgor_ros.core.index.surface import EDGE_ON
from sgor_ros.core.index.surface import FAR
from sgor_ros.core.index.surface import FEWEST
from sgor_ros.core.index.surface import surface
from sgor_ros.core.scan.voxels import voxel_grid
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

EDGE = 0.5


@pytest.fixture(scope='module')
def clouds(street):
    """Return thinned points of two street scans, 1.5 m apart, and T_target_source."""
    target, source = (voxel_grid(points, np.zeros(len(points), np.uint8), EDGE).points
                      for points, _, _ in street[:2])
    return source, target, relative(street[0][2], street[1][2])


def of_nearest_ten(points):
    """Return the surface with the normals that any ten points have, lines and all."""
    found = surface(points, EDGE)
    points = found.columns.points
    nearest = cKDTree(points).query(points, 10)[1]
    vectors = np.linalg.eigh(np.array([np.cov(points[rows].T) for rows in nearest]))[1]
    return replace(found, normals=np.ascontiguousarray(vectors[:, :, 0]))


@pytest.mark.parametrize('stretch', [1.0, 1000.0])
def test_each_point_is_in_its_column(clouds, stretch):
    """Every one once; where they reach far the columns are wider, not more."""
    points = clouds[0] * stretch
    columns = in_columns(points, EDGE)
    np.testing.assert_array_equal(np.sort(columns.order), np.arange(len(points)))
    np.testing.assert_array_equal(columns.points, points[columns.order])
    assert columns.first[-1] == len(points)
    assert len(columns.first) <= MOST_COLUMNS + 1
    x, y = np.floor((columns.points[:, :2] - columns.low) / columns.edge).astype(int).T
    of_point = np.repeat(np.arange(len(columns.first) - 1), np.diff(columns.first))
    np.testing.assert_array_equal(x * columns.ny + y, of_point)


def test_no_points_have_no_columns():
    assert in_columns(np.empty((0, 3)), EDGE).first.tolist() == [0, 0]


def test_normals_are_those_of_the_nearest_ten(clouds):
    """As far as they are looked for; the smallest principal component of them.

    What is seen edge-on has none.
    """
    found = surface(clouds[0], EDGE)
    points = found.columns.points
    distance, nearest = cKDTree(points).query(points, 10)
    near = np.flatnonzero(distance[:, -1] < FAR * EDGE)
    assert len(near) > 0.8 * len(points)
    values, vectors = np.linalg.eigh(
        np.array([np.cov(points[nearest[i]].T, bias=True) for i in near]))
    facing = np.abs((vectors[:, :, 0] * points[near]).sum(axis=1)) / np.linalg.norm(
        points[near], axis=1)
    clear = (values[:, 0] < 0.5 * values[:, 1]) & (np.abs(facing - EDGE_ON) > 1e-6)
    assert clear.mean() > 0.7
    seen = clear & (facing > EDGE_ON)
    cosine = np.abs((vectors[:, :, 0] * found.normals[near]).sum(axis=1))
    np.testing.assert_allclose(cosine[seen], 1.0, atol=1e-6)
    hidden = clear & (facing < EDGE_ON)
    assert hidden.sum() > 20
    assert not found.normals[near[hidden]].any()
    lengths = np.linalg.norm(found.normals, axis=1)
    assert (np.isclose(lengths, 1.0, atol=1e-9) | (lengths == 0.0)).all()


def test_a_point_by_itself_has_no_normal():
    rng = np.random.default_rng(0)
    points = np.vstack((np.c_[rng.uniform(-3, 3, (200, 2)), np.zeros(200)], [[30.0, 0, 0]]))
    found = surface(points, EDGE, np.array([0.0, 0.0, 2.0]))
    alone = np.flatnonzero(found.columns.order == 200)[0]
    assert not found.normals[alone].any()
    np.testing.assert_allclose(np.abs(np.delete(found.normals, alone, axis=0)),
                               np.tile([0, 0, 1], (200, 1)), atol=1e-9)
    assert FEWEST > 1


def test_gicp_is_that_of_small_gicp(clouds):
    """To millimetres from decimetres off, with as many pairs: on normals that both have."""
    small_gicp = pytest.importorskip('small_gicp')
    source, target, truth = clouds
    start = truth.copy()
    start[:3, 3] += (0.1, -0.05, 0.05)
    found = align(of_nearest_ten(source), of_nearest_ten(target), start, SgorConfig())
    theirs = []
    for points in (source, target):
        cloud = small_gicp.PointCloud(points)
        tree = small_gicp.KdTree(cloud)
        small_gicp.estimate_covariances(cloud, tree, num_neighbors=10)
        theirs.append((cloud, tree))
    known = small_gicp.align(theirs[1][0], theirs[0][0], theirs[1][1], start,
                             registration_type='GICP', max_correspondence_distance=0.5,
                             translation_epsilon=1e-5, rotation_epsilon=1e-6)
    metres, degrees = errors(found.T_target_source, known.T_target_source)
    assert metres < 0.003
    assert degrees < 0.01
    assert found.pairs == pytest.approx(known.num_inliers, rel=0.01)


def test_threads_change_nothing(clouds):
    source, target, truth = clouds
    found = []
    for threads in (1, 2):
        with cores(threads):
            found.append(align(surface(source, EDGE), surface(target, EDGE), truth, SgorConfig()))
    np.testing.assert_array_equal(found[0].T_target_source, found[1].T_target_source)
    np.testing.assert_array_equal(found[0].covariance, found[1].covariance)


def test_middle_range_is_from_the_sensor(clouds):
    """Wherever it is in the frame of the points, which changes no normal either."""
    at = np.array([120.0, -40.0, 3.0])
    plain, shifted = surface(clouds[0], EDGE), surface(clouds[0] + at, EDGE, at)
    assert shifted.middle_range == pytest.approx(plain.middle_range, abs=1e-9)
    there = cKDTree(shifted.columns.points - at).query(plain.columns.points)[1]
    cosine = np.abs((plain.normals * shifted.normals[there]).sum(axis=1))
    none = ~plain.normals.any(axis=1)
    assert none.sum() > 100
    # the few that lie between two columns may have other partners
    assert (cosine[~none] > 0.999).mean() > 0.995
    assert (cosine[none] == 0).mean() > 0.98


def test_the_fan_of_one_beam_has_no_normals():
    """It is a plane that the sensor lies in."""
    rng = np.random.default_rng(0)
    polar = np.c_[rng.uniform(5, 9, 4000), rng.uniform(0, 2 * np.pi, 4000)]
    fan = np.c_[polar[:, 0] * np.cos(polar[:, 1]), polar[:, 0] * np.sin(polar[:, 1]),
                polar[:, 0] * np.tan(np.radians(2.0))]
    assert not surface(fan, EDGE).normals.any()
    # seen from 1 m above it is a surface: cosine 1 / 9 and more
    high = surface(fan * [1, 1, 0], EDGE, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(np.abs(high.normals), np.tile([0, 0, 1], (len(fan), 1)), atol=1e-9)


def test_roll_and_pitch_of_16_beams():
    """Of two scans of the street to 0.1 degrees, from 1 degree and 0.2 m off."""
    lidar = Lidar(beams=16, columns=900)
    scans = [scan[1:] for scan in simulate(3, seed=0, lidar=lidar, speed=15.0)]
    source, target = (surface(voxel_grid(points, np.zeros(len(points), np.uint8), EDGE).points,
                              EDGE) for points, _, _ in (scans[2], scans[0]))
    truth = relative(scans[0][2], scans[2][2])
    offset = np.eye(4)
    offset[:3, :3] = Rotation.from_euler('xy', [1.0, -1.0], degrees=True).as_matrix()
    offset[:3, 3] = 0.1, -0.1, 0.1
    found = align(source, target, truth @ offset, SgorConfig()).T_target_source
    roll, pitch = Rotation.from_matrix((np.linalg.inv(truth) @ found)[:3, :3]).as_euler(
        'xyz', degrees=True)[:2]
    assert abs(roll) < 0.1
    assert abs(pitch) < 0.1
