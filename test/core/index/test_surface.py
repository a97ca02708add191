"""Columns, normals of the nearest ten, and GICP on them against small_gicp's."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial import cKDTree

from sgor_ros import SgorConfig
from sgor_ros.core.execution.threads import cores
from sgor_ros.core.icp.gicp import align
from sgor_ros.core.index.columns import in_columns
from sgor_ros.core.index.columns import MOST_COLUMNS
from sgor_ros.core.index.surface import FAR
from sgor_ros.core.index.surface import FEWEST
from sgor_ros.core.index.surface import surface
from sgor_ros.core.scan.voxels import voxel_grid

EDGE = 0.5


@pytest.fixture(scope='module')
def clouds(street):
    """Return thinned points of two street scans, 1.5 m apart, and T_target_source."""
    target, source = (voxel_grid(points, np.zeros(len(points), np.uint8), EDGE).points
                      for points, _, _ in street[:2])
    return source, target, relative(street[0][2], street[1][2])


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
    """As far as they are looked for; the smallest principal component of them."""
    found = surface(clouds[0], EDGE)
    points = found.columns.points
    distance, nearest = cKDTree(points).query(points, 10)
    near = np.flatnonzero(distance[:, -1] < FAR * EDGE)
    assert len(near) > 0.8 * len(points)
    lengths = np.linalg.norm(found.normals, axis=1)
    np.testing.assert_allclose(lengths[near], 1.0, atol=1e-9)
    values, vectors = np.linalg.eigh(np.array([np.cov(points[nearest[i]].T) for i in near]))
    clear = values[:, 0] < 0.5 * values[:, 1]
    cosine = np.abs((vectors[:, :, 0] * found.normals[near]).sum(axis=1))
    np.testing.assert_allclose(cosine[clear], 1.0, atol=1e-6)


def test_a_point_by_itself_has_no_normal():
    rng = np.random.default_rng(0)
    points = np.vstack((np.c_[rng.uniform(-3, 3, (200, 2)), np.zeros(200)], [[30.0, 0, 0]]))
    found = surface(points, EDGE)
    alone = np.flatnonzero(found.columns.order == 200)[0]
    assert not found.normals[alone].any()
    np.testing.assert_allclose(np.abs(np.delete(found.normals, alone, axis=0)),
                               np.tile([0, 0, 1], (200, 1)), atol=1e-9)
    assert FEWEST > 1


def test_gicp_is_that_of_small_gicp(clouds):
    """To millimetres from decimetres off, with as many pairs."""
    small_gicp = pytest.importorskip('small_gicp')
    source, target, truth = clouds
    start = truth.copy()
    start[:3, 3] += (0.1, -0.05, 0.05)
    found = align(surface(source, EDGE), surface(target, EDGE), start, SgorConfig())
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
