"""The way in: what a scan may be made of, and what is said about the rest."""
import numpy as np
import pytest

from sgor_ros import InputError
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import register_correspondences
from sgor_ros import SemanticScan
from sgor_ros import Tracker

NAN = float('nan')


def test_lists_are_taken():
    """Points become float32, labels int64."""
    scan = SemanticScan([[1, 2, 3], [4, 5, 6.5]], [40, 50])
    assert len(scan) == 2
    assert scan.points.dtype == np.float32
    assert scan.labels.dtype == np.int64
    np.testing.assert_array_equal(scan.points, [[1, 2, 3], [4, 5, 6.5]])
    np.testing.assert_array_equal(scan.labels, [40, 50])


@pytest.mark.parametrize('dtype', [np.uint8, np.int16, np.uint32, np.int64])
def test_integers_of_any_width_are_labels(dtype):
    assert SemanticScan(np.ones((2, 3)), np.array([7, 9], dtype)).labels.tolist() == [7, 9]


def test_without_labels():
    assert SemanticScan(np.ones((2, 3))).labels is None


@pytest.mark.parametrize('order', ['C', 'F'])
@pytest.mark.parametrize('dtype', ['<f4', '>f4', '<f8', '>f8', '<i4'])
def test_any_number_type_and_memory_layout(dtype, order):
    """Both endians, both precisions, columns first: the same scan."""
    points = np.arange(12.0).reshape(4, 3)
    scan = SemanticScan(np.asarray(points.astype(dtype), order=order))
    np.testing.assert_array_equal(scan.points, points)
    assert scan.points.flags.c_contiguous
    assert scan.points.dtype.isnative


@pytest.mark.parametrize('bad', [NAN, float('inf'), -float('inf')])
def test_rows_that_are_not_finite_go_with_their_labels(bad):
    """Any of the three coordinates; the labels of the others stay beside their points."""
    points = np.arange(15.0).reshape(5, 3)
    points[0, 0], points[2, 1], points[4, 2] = bad, bad, bad
    scan = SemanticScan(points, [1, 2, 3, 4, 5])
    np.testing.assert_array_equal(scan.points, [[3, 4, 5], [9, 10, 11]])
    assert scan.labels.tolist() == [2, 4]
    assert len(SemanticScan(points)) == 2


@pytest.mark.parametrize(('points', 'labels', 'words'), [
    (np.ones((4, 2)), None, r'points: expected an \(N, 3\) array, got shape \(4, 2\)'),
    (np.ones((4, 4)), None, r'points: .*\(4, 4\)'),
    (np.ones(3), None, r'points: .*\(3,\)'),
    (np.ones((2, 2, 3)), None, r'points: .*\(2, 2, 3\)'),
    ([], None, r'points: .*\(0,\)'),
    ('cloud', None, 'points: not an array of numbers'),
    (None, None, 'points'),
    ([[1, 2, 3], [4, 5]], None, 'points: not an array of numbers'),
    ([['a', 'b', 'c']], None, 'points: not an array of numbers'),
    (np.zeros((4, 3), 'M8[s]'), None, 'points: not an array of numbers, but of datetime64'),
    (np.zeros((4, 3), 'm8[s]'), None, 'points: not an array of numbers, but of timedelta64'),
    (np.ones((4, 3), complex), None, 'points: not an array of numbers, but of complex128'),
    (np.ones((4, 3), bool), None, 'points: not an array of numbers, but of bool'),
    (np.ones((4, 3)), np.zeros(4, 'm8[s]'), 'labels: expected integers, got timedelta64'),
    (np.ones((4, 3)), [[1], [2, 3], [4], [5]], 'labels: expected integers'),
    (np.empty((0, 3)), None, 'points: the scan is empty'),
    (np.full((7, 3), NAN), None, 'points: none of 7 is finite'),
    (np.ones((4, 3)), [1, 2, 3], r'labels: expected one a point, \(4,\), got shape \(3,\)'),
    (np.ones((4, 3)), np.ones((4, 1), int), r'labels: .*\(4, 1\)'),
    (np.ones((4, 3)), 5, r'labels: .*\(\)'),
    (np.ones((4, 3)), np.ones(4), 'labels: expected integers, got float64'),
    (np.ones((4, 3)), np.ones(4, bool), 'labels: expected integers, got bool'),
    (np.ones((4, 3)), ['a', 'b', 'c', 'd'], 'labels: expected integers'),
])
def test_what_is_no_scan_is_refused_by_name(points, labels, words):
    """The message names the field and what came instead."""
    with pytest.raises(InputError, match=words):
        SemanticScan(points, labels)


@pytest.mark.filterwarnings('error')
def test_what_float32_cannot_hold_is_not_finite():
    assert SemanticScan([[1e300, 0, 0], [1, 2, 3]]).points.tolist() == [[1, 2, 3]]


def test_points_can_stand_for_a_scan(street):
    """Arrays are scans without labels; the result is the same."""
    (target, _, _), (source, _, _) = street[0], street[1]
    by_scans = register(SemanticScan(source), SemanticScan(target))
    by_arrays = register(source, target)
    # threads add up in any order
    np.testing.assert_allclose(by_arrays.T_target_source, by_scans.T_target_source, atol=1e-9)
    assert preprocess(source).scan.labels is None


@pytest.mark.parametrize('call', [
    lambda scan, config: register(scan, scan, config), preprocess,
    lambda scan, config: register_correspondences(scan, scan, config=config),
    lambda scan, config: Tracker(config)])
def test_a_configuration_is_one_or_none(call):
    scan = np.random.default_rng(0).normal(0, 5, (50, 3))
    call(scan, None)
    for config in ({}, {'voxel_size': 1.0}):
        with pytest.raises(InputError, match=r'expected SgorConfig, got dict; SgorConfig\(\*\*'):
            call(scan, config)
    with pytest.raises(InputError, match='config: expected SgorConfig, got str'):
        call(scan, 'outdoor')


@pytest.mark.parametrize(('source', 'target', 'says'), [
    (None, np.ones((4, 3)), 'source: neither a SemanticScan nor .* but of object'),
    (np.ones((4, 3)), np.ones((4, 4)), r'target: neither a SemanticScan nor .* \(4, 4\)'),
    (np.ones((4, 3)), 'a.bin', 'target: neither a SemanticScan')])
def test_what_cannot_be_registered_is_named(source, target, says):
    with pytest.raises(InputError, match=says):
        register(source, target)


def test_a_prepared_scan_is_not_prepared_again():
    prepared = preprocess(np.random.default_rng(0).normal(0, 5, (50, 3)))
    with pytest.raises(InputError, match='scan: it has been preprocessed already'):
        preprocess(prepared)


def test_everything_prints_in_a_few_lines(street):
    (target, labels, _), (source, _, _) = street[0], street[1]
    scan = SemanticScan(target, labels)
    for thing, says in ((scan, f'SemanticScan({len(target)} points, '),
                        (preprocess(scan), 'keypoints, scale 1)')):
        assert says in repr(thing)
        assert len(repr(thing)) < 100
    good, bad = register(source, target), register(np.ones((30, 3)), scan)
    for result, says in ((good, 'Registration(registered'),
                         (bad, f'Registration(not registered: {bad.reason}')):
        assert repr(result).startswith(says)
        assert len(str(result).splitlines()) < 15
    assert f'T_target_source [[ {good.T_target_source[0, 0]:.2f}'[:22] in repr(good)


def test_labels_are_checked_against_the_points_as_given():
    """Not against those that are left when NaN is gone: the caller counts his own."""
    points = np.ones((3, 3))
    points[1] = NAN
    assert SemanticScan(points, [1, 2, 3]).labels.tolist() == [1, 3]
    with pytest.raises(InputError, match='labels'):
        SemanticScan(points, [1, 3])


@pytest.mark.parametrize('kind', [np.float32, np.float64])
def test_a_scan_keeps_no_buffer_of_the_caller(kind):
    """A driver fills one buffer again and again."""
    points, labels = np.full((10, 3), 5, kind), np.full(10, 40, np.int64)
    scan = SemanticScan(points, labels)
    points[:], labels[:] = 7, 50
    assert (scan.points == 5).all()
    assert (scan.labels == 40).all()
    view = np.asfortranarray(np.full((10, 4), 5, kind))
    scan = SemanticScan(view[:, :3])
    view[:] = 7
    assert (scan.points == 5).all()
    assert scan.points.flags.c_contiguous


def test_rounding_of_map_coordinates_is_told():
    """UTM northings are kept to a quarter of a metre; the scan is refused, and both are said."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-20, 20, (5000, 3))
    at = points + [4e5, 5.4e6, 100]
    scan = SemanticScan(at)
    worst = np.abs(scan.points - at).max(axis=1)
    assert scan.rounding == np.median(worst) > 0.1
    warning, = (w for w in preprocess(scan).warnings if 'float32' in w)
    assert warning.startswith('points: ')
    assert 'by 0.13 m' in warning
    result = register(scan, SemanticScan(points))
    assert not result.success
    assert any('source: points: rounded' in w for w in result.warnings)
    assert any('beyond max_range' in w and 'in the frame of the sensor' in w
               for w in result.warnings)


def test_rounding_that_is_nothing_is_not_told():
    """Near the sensor; for float32, which has nothing to lose; for a few points far off."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-20, 20, (5000, 3))
    for given in (points, (points + 5.4e6).astype(np.float32),
                  np.concatenate((points, np.full((20, 3), 1e7)))):
        scan = SemanticScan(given)
        assert scan.rounding < 1e-5
        assert not any('float32' in w for w in preprocess(scan).warnings)


def test_rounding_is_told_in_small_spaces_too():
    """What is near is gridded a second time, at a scale of its own."""
    rng = np.random.default_rng(0)
    room, far = rng.uniform(-2, 2, (2000, 3)), rng.uniform(-2, 2, (3000, 3)) + 5.4e6
    prepared = preprocess(SemanticScan(np.concatenate((room, far))))
    assert prepared.scale < 1
    assert any('float32' in w for w in prepared.warnings)
