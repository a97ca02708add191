"""One scan made ready: what takes part, and descriptors from elsewhere."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial import cKDTree

from sgor_ros import InputError
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig

ROAD, BUILDING, MOVING_CAR, PERSON = 40, 50, 252, 30    # ids of SemanticKITTI


@pytest.fixture(scope='module')
def scans(street):
    return [SemanticScan(points, labels) for points, labels, _ in street[:2]]


@pytest.fixture(scope='module')
def prepared(scans):
    return [preprocess(scan) for scan in scans]


def test_keypoints_stand_over_the_ground(prepared):
    """No keypoint on the plane; heights are those over it."""
    features, ground = prepared[0].features, prepared[0].ground
    assert ground.source == 'labels'
    heights = features.points @ ground.normal + ground.offset
    np.testing.assert_allclose(features.heights, heights, atol=1e-9)
    assert (np.abs(heights) >= SgorConfig().sigma_g).all()
    assert ground.offset == pytest.approx(1.73, abs=0.1)


def test_surfaces_have_grids_of_their_own_and_always_the_same(scans, prepared):
    """A scan moved by nothing but its noise is cut elsewhere; the same scan is cut the same."""
    def surface_of(points):
        return np.array(preprocess(SemanticScan(points, scans[0].labels)).surface.columns.points)

    np.testing.assert_array_equal(surface_of(scans[0].points),
                                  prepared[0].surface.columns.points)
    other = surface_of(scans[0].points + np.float32(1e-5))
    far = cKDTree(prepared[0].surface.columns.points).query(other)[0]
    assert np.median(far) > 0.02


def test_descriptors_are_unit_rows(prepared):
    lengths = np.linalg.norm(prepared[0].features.descriptors, axis=1)
    assert (np.isclose(lengths, 1, atol=1e-5) | (lengths == 0)).all()
    assert (lengths > 0).mean() > 0.99


def test_points_out_of_range_take_no_part(scans):
    """Neither nearer than min_range nor farther than max_range."""
    features = preprocess(scans[0], SgorConfig(min_range=6.0, max_range=20.0)).features
    distance = np.linalg.norm(features.points, axis=1)
    assert distance.min() > 5.5    # the mean of a voxel may be a little nearer
    assert distance.max() < 20.0
    assert distance.max() > 18.0


@pytest.mark.parametrize('label', [MOVING_CAR, PERSON])
def test_what_moves_takes_part_only_when_asked(scans, label):
    """A box of a movable class beside the road: keypoints there only with moving_vote."""
    box = np.random.default_rng(0).uniform(-1, 1, (2000, 3)) + [6, 0, 0.5]
    scan = SemanticScan(np.vstack((scans[0].points, box)),
                        np.append(scans[0].labels, np.full(2000, label)))

    def inside(config):
        points = preprocess(scan, config).features.points
        return (np.abs(points - [6, 0, 0.5]) < 1).all(axis=1).sum()

    assert inside(SgorConfig(moving_vote=True)) > 20
    assert inside(SgorConfig()) == 0


def test_ablation_without_preprocessing_keeps_the_ground(scans):
    """Setting correspondence_preprocessing off: ground points are matched like all others."""
    everything = preprocess(scans[0], SgorConfig(correspondence_preprocessing=False)).features
    assert (np.abs(everything.heights) < 0.25).mean() > 0.2


def test_a_scan_of_nothing_but_ground():
    """A flat floor has no keypoints, which is said by the registration and is no crash."""
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(-20, 20, (3000, 2)), np.full(3000, -1.7)]
    for labels in (None, np.full(3000, ROAD)):
        flat = preprocess(SemanticScan(floor, labels))
        assert len(flat.features.points) == 0
        result = register(flat, flat)
        assert not result.success
        assert result.reason == 'only 0 correspondences'
        assert result.T_target_source is None


def test_descriptors_of_the_caller_register(scans, prepared, street):
    """Keypoints and learned features of the caller take the place of voxels and FPFH."""
    given = [preprocess(scan, keypoints=p.features.points, descriptors=p.features.descriptors)
             for scan, p in zip(scans, prepared, strict=True)]
    for mine, own in zip(given, prepared, strict=True):
        np.testing.assert_allclose(mine.features.points, own.features.points)
        np.testing.assert_allclose(mine.features.descriptors, own.features.descriptors, atol=1e-6)
        assert np.array_equal(mine.features.regional, own.features.regional)
    result = register(given[1], given[0])
    assert result.success
    metres, degrees = errors(result.T_target_source, relative(street[0][2], street[1][2]))
    assert metres < 0.05
    assert degrees < 0.2


def test_descriptors_of_the_caller_decide(scans, prepared):
    """Descriptors that name the keypoint match each to itself, 5 columns or 500."""
    points = prepared[0].features.points[::10]
    name = np.random.default_rng(0).normal(size=(len(points), 8))
    one = preprocess(scans[0], keypoints=points, descriptors=name)
    result = register(one, one, SgorConfig(local_refinement=False))
    np.testing.assert_allclose(result.source_points, result.target_points)
    assert result.inliers.all()


def test_keypoints_of_the_caller_on_ground_or_nowhere_are_left_out(scans, prepared):
    """They have no voxel near: on the road, out of range, where nothing was measured."""
    good = prepared[0].features.points[:50]
    bad = np.array([[5, 0, -1.73], [0, 300, 0], [0, 0, 50]])
    given = preprocess(scans[0], keypoints=np.vstack((good, bad)), descriptors=np.eye(53))
    np.testing.assert_allclose(given.features.points, good)
    np.testing.assert_allclose(given.features.descriptors, np.eye(53)[:50])


@pytest.mark.parametrize(('keypoints', 'descriptors', 'words'), [
    (np.ones((4, 3)), None, 'keypoints and descriptors: give both or none'),
    (None, np.ones((4, 8)), 'keypoints and descriptors: give both or none'),
    (np.ones((4, 3)), np.ones((5, 8)), r'descriptors: .*\(4, D\), got shape \(5, 8\)'),
    (np.ones((4, 3)), np.ones(4), r'descriptors: .*\(4, D\), got shape \(4,\)'),
    (np.ones((4, 2)), np.ones((4, 8)), r'keypoints: expected an \(N, 3\) array'),
    (np.full((4, 3), np.nan), np.ones((4, 8)), 'keypoints: row 0 is not finite'),
    (np.ones((4, 3)), np.full((4, 8), np.nan), 'descriptors: not all are finite'),
    (np.ones((4, 3)), [['a'] * 8] * 4, 'descriptors: not an array of numbers'),
])
def test_what_is_no_keypoint_or_descriptor_is_refused(scans, keypoints, descriptors, words):
    with pytest.raises(InputError, match=words):
        preprocess(scans[0], keypoints=keypoints, descriptors=descriptors)


def test_descriptors_of_different_kinds_do_not_match(scans, prepared):
    """FPFH here, learned ones there: an error, not a wrong answer."""
    points = prepared[0].features.points
    learned = preprocess(scans[0], keypoints=points, descriptors=np.ones((len(points), 32)))
    with pytest.raises(InputError, match='descriptors: source has 32 columns, target 33'):
        register(learned, prepared[1])
