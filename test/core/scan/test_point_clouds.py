"""Clouds as other libraries have them are scans, and what is none is named."""
import numpy as np
import pytest

from sgor_ros import InputError
from sgor_ros import SemanticScan

POINTS = np.random.default_rng(0).normal(0, 9, (50, 3)).astype(np.float32)
LABELS = np.arange(50)


def structured(fields=('x', 'y', 'z', 'intensity', 'label'), shape=(50,)):
    array = np.zeros(50, [(name, np.uint16 if name in ('label', 'class_id') else np.float32)
                          for name in fields])
    for axis, column in zip('xyz', POINTS.T, strict=True):
        if axis in fields:
            array[axis] = column
    for name in {'label', 'class_id'}.intersection(fields):
        array[name] = LABELS
    return array.reshape(shape)


@pytest.mark.parametrize('shape', [(50,), (5, 10)])
@pytest.mark.parametrize('field', ['label', 'class_id'])
def test_fields_of_ros(shape, field):
    """As point_cloud2.read_points returns them, organized or not."""
    scan = SemanticScan(structured(('x', 'intensity', 'y', 'z', field), shape))
    np.testing.assert_array_equal(scan.points, POINTS)
    np.testing.assert_array_equal(scan.labels, LABELS)
    given = SemanticScan(structured(), LABELS[::-1])
    np.testing.assert_array_equal(given.labels, LABELS[::-1])
    assert SemanticScan(structured(('x', 'y', 'z'))).labels is None


def test_a_fourth_column_is_left_out():
    scan = SemanticScan(np.column_stack((POINTS, np.full(50, 7))))
    np.testing.assert_array_equal(scan.points, POINTS)
    assert scan.labels is None


def test_clouds_and_tensors_of_open3d():
    o3d = pytest.importorskip('open3d')
    legacy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS.astype(np.float64)))
    tensor = o3d.t.geometry.PointCloud(o3d.core.Tensor(POINTS))
    for cloud in (legacy, tensor, o3d.core.Tensor(POINTS)):
        np.testing.assert_array_equal(SemanticScan(cloud).points, POINTS)


def test_tensors_that_need_a_gradient():
    torch = pytest.importorskip('torch')
    np.testing.assert_array_equal(
        SemanticScan(torch.tensor(POINTS, requires_grad=True)).points, POINTS)


@pytest.mark.parametrize(('cloud', 'says'), [
    (structured(('x', 'y', 'label')), 'points: no field z; there are x, y, label'),
    (np.zeros(3, [('x', 'S4'), ('y', 'f4'), ('z', 'f4')]), 'points: field x: not an array of num'),
    (np.zeros((9, 5)), r'expected an \(N, 3\) array, got shape \(9, 5\)'),
    (object(), 'points: not an array of numbers')])
def test_what_is_no_cloud_is_named(cloud, says):
    with pytest.raises(InputError, match=says):
        SemanticScan(cloud)
