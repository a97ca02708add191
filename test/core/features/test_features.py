"""Voxels with votes, normals, regional labels and FPFH, against plain or other implementations."""
import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from sgor_ros.core.features.descriptors import fpfh
from sgor_ros.core.features.descriptors import normals
from sgor_ros.core.features.descriptors import regional_labels
from sgor_ros.core.features.neighbours import radius_neighbours
from sgor_ros.core.scan.voxels import one_point_voxels
from sgor_ros.core.scan.voxels import shift_of
from sgor_ros.core.scan.voxels import voxel_grid


@pytest.fixture(scope='module')
def cloud(street):
    """Return the voxels of a street scan above the road."""
    points, labels, _ = street[0]
    grid = voxel_grid(points, (labels % 251).astype(np.uint8), 0.5)
    return grid[grid.points[:, 2] > -1.3]


def open3d_cloud(points):
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))


def test_voxels_by_hand():
    """Means of the members; the label most of them have, not the first."""
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.2, 0.4, 0.1], [-0.1, 0, 0]],
                      np.float32)
    grid = voxel_grid(points, np.array([1, 7, 7, 2], np.uint8), 0.5)
    np.testing.assert_allclose(grid.points, [[0.2, 0.2, 0.1], [-0.1, 0, 0]], atol=1e-6)
    assert list(grid.labels) == [7, 2]
    assert list(grid.votes.sum(axis=1)) == [3, 1]


def test_a_grid_that_is_shifted():
    """By a quarter of a voxel, 0.45 falls among what is beyond 0.5; where depends on the scan."""
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.45, 0.1, 0.1]], np.float32)
    labels = np.zeros(3, np.uint8)
    assert len(voxel_grid(points, labels, 0.5).points) == 1
    grid = voxel_grid(points, labels, 0.5, 0.25)
    np.testing.assert_allclose(grid.points[:, 0], [0.2, 0.45], atol=1e-6)
    shifts = [shift_of(points + np.float32(k)) for k in range(100)]
    assert shifts == [shift_of(points + np.float32(k)) for k in range(100)]
    assert 0 <= min(shifts) < 0.1 < 0.9 < max(shifts) < 1


def test_unlabelled_points_do_not_vote():
    """One labelled point outvotes any number without a label."""
    points = np.zeros((5, 3), np.float32)
    assert voxel_grid(points, np.array([0, 0, 0, 0, 4], np.uint8), 1.0).labels[0] == 4
    assert voxel_grid(points, np.zeros(5, np.uint8), 1.0).labels[0] == 0


def test_voxels_do_not_depend_on_the_order_of_points(street):
    """Shuffled input, same set of voxels."""
    points, labels, _ = street[0]
    labels = (labels % 251).astype(np.uint8)
    order = np.random.default_rng(0).permutation(len(points))
    a, b = voxel_grid(points, labels, 0.5), voxel_grid(points[order], labels[order], 0.5)
    rows_a, rows_b = (np.lexsort(np.round(g.points, 6).T) for g in (a, b))
    np.testing.assert_allclose(a.points[rows_a], b.points[rows_b], atol=1e-9)
    assert np.array_equal(a.labels[rows_a], b.labels[rows_b])


@pytest.mark.parametrize('radius', [0.7, 3.5])
def test_neighbours_equal_a_kd_tree(cloud, radius):
    """The same sets as scipy's tree, the point itself first, right distances."""
    found = radius_neighbours(cloud.points, radius)
    expected = cKDTree(cloud.points).query_ball_point(cloud.points, radius)
    for i, row in enumerate(expected):
        part = slice(found.start[i], found.start[i + 1])
        assert found.index[part][0] == i
        assert sorted(found.index[part]) == sorted(row)
        distance = np.linalg.norm(cloud.points[found.index[part]] - cloud.points[i], axis=1)
        np.testing.assert_allclose(found.squared[part], distance**2, atol=1e-5)


def test_neighbours_of_nothing_and_of_one_point():
    """No points, no neighbours; one point has itself."""
    assert len(radius_neighbours(np.empty((0, 3)), 1.0).index) == 0
    assert list(radius_neighbours(np.ones((1, 3)), 1.0).index) == [0]


def test_normals_equal_open3d(cloud):
    """The same directions as Open3D's radius search, all towards the sensor."""
    found = normals(cloud.points, radius_neighbours(cloud.points, 1.5), 1.5)
    reference = open3d_cloud(cloud.points)
    reference.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(1.5))
    counts = np.diff(radius_neighbours(cloud.points, 1.5).start)
    cosine = np.abs(np.einsum('ij,ij->i', found, np.asarray(reference.normals)))[counts >= 4]
    assert np.quantile(cosine, 0.01) > 0.9999
    assert (np.einsum('ij,ij->i', found, cloud.points) <= 1e-9).all()
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-9)


def test_normals_of_a_line_lie_across_it():
    """Points on a pole: any unit direction across it."""
    pole = np.c_[np.full(20, 3.0), np.zeros(20), np.linspace(0, 2, 20)]
    found = normals(pole, radius_neighbours(pole, 1.0), 1.0)
    np.testing.assert_allclose(found[:, 2], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-9)


def test_fpfh_equals_open3d(cloud):
    """The descriptor is Open3D's; single bins may fall to the other side by rounding."""
    neighbours = radius_neighbours(cloud.points, 3.5)
    directions = normals(cloud.points, neighbours, 1.5)
    found = fpfh(cloud.points, directions, neighbours)
    reference = open3d_cloud(cloud.points)
    reference.normals = o3d.utility.Vector3dVector(directions)
    expected = o3d.pipelines.registration.compute_fpfh_feature(
        reference, o3d.geometry.KDTreeSearchParamRadius(3.5)).data.T
    expected = expected / np.maximum(np.linalg.norm(expected, axis=1, keepdims=True), 1e-12)
    difference = np.linalg.norm(found - expected, axis=1)
    assert np.median(difference) < 1e-3
    assert np.quantile(difference, 0.95) < 0.05
    # rounding must not change which descriptor is nearest
    nearest = cKDTree(expected).query(found)[1]
    assert (nearest == np.arange(len(found))).mean() > 0.98


def test_regional_votes_mend_half_of_all_labels():
    """Two halves of a wall with half of the labels at random: the region still knows."""
    rng = np.random.default_rng(0)
    points = np.c_[np.zeros(4000), rng.uniform(-10, 10, 4000), rng.uniform(0, 4, 4000)]
    truth = np.where(points[:, 1] < 0, 13, 15).astype(np.uint8)
    noisy = np.where(rng.random(4000) < 0.5, rng.integers(1, 20, 4000), truth).astype(np.uint8)
    grid = voxel_grid(points.astype(np.float32), noisy, 0.5)
    voted = regional_labels(grid, radius_neighbours(grid.points, 3.0), 1.0)
    right = np.where(grid.points[:, 1] < 0, 13, 15)
    inside = np.abs(grid.points[:, 1]) > 1.0
    assert (voted == right)[inside].mean() > 0.99
    assert (grid.labels == right)[inside].mean() < (voted == right)[inside].mean()


def test_vote_counts_raw_points_within_the_radius():
    """By hand: three of class 2 at 0.4 m outvote one of class 1 here; one at 2 m is too far."""
    points = np.array([[0, 0, 0], [0.4, 0, 0], [2.0, 0, 0]], float)
    grid = one_point_voxels(points, np.array([1, 2, 3], np.uint8))
    grid.votes[1, 1] = 3
    voted = regional_labels(grid, radius_neighbours(points, 3.0), 1.0)
    assert list(voted) == [2, 2, 3]
