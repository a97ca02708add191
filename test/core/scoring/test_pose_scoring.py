"""What the clouds say about a transformation: partners and free space."""
import math

from conftest import relative
from galleries import seen
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import preprocess
from sgor_ros import SemanticScan
from sgor_ros.core.features.features import Features
from sgor_ros.core.index.scan_index import scan_index
from sgor_ros.core.scoring.pose_scoring import pose_score
from sgor_ros.core.scoring.pose_scoring import rough_scores
from sgor_ros.core.scoring.pose_scoring import score_keypoints

REACH = 0.6
UP = np.array([0.0, 0.0, 1.0])
WALL, POLE = 13, 18
NOTHING_SEEN = np.array([[0, 0, 50]], np.float32)    # a single return, straight up


def score_pose(source, target, T):
    """Ask all keypoints of both scans."""
    most = max(len(source.points), len(target.points))
    return pose_score(score_keypoints(source, target, T[None], most)[0])


def keypoints(points, labels):
    points = np.array(points, float).reshape(-1, 3)
    labels = np.array(labels, np.uint8)
    return Features(points, labels, labels, np.zeros((len(points), 3), np.float32))


def view_of(points, keys, facing=(-1.0, 0.0, 0.0)):
    """Return the view of a sensor whose keypoints all face one way."""
    return scan_index(seen(points), keys, np.tile(facing, (len(keys.points), 1)), UP, REACH)


@pytest.fixture(scope='module')
def wall():
    """Return the view of a sensor that sees one wall at 10 m, with two keypoints on it."""
    y, z = np.meshgrid(np.arange(-5, 5, 0.05), np.arange(-2, 3, 0.05))
    points = np.c_[np.full(y.size, 10.0), y.ravel(), z.ravel()].astype(np.float32)
    return view_of(points, keypoints([[10, 0, 0], [10, 3, 0]], [WALL, WALL]))


def asked(wall, points, labels, T=None):
    """Return what both say of keypoints of a source that itself has seen nothing."""
    source = view_of(NOTHING_SEEN, keypoints(points, labels))
    return score_pose(source, wall, np.eye(4) if T is None else T)


@pytest.mark.parametrize(('point', 'agree', 'contradict'), [
    ((10.15, 0.2, 0), 1, 0),    # on the wall, as far as the wall is known
    ((10.3, 0.2, 0), 0, 0),     # near it, but not on it
    ((5, 0, 0), 0, 1),          # hangs where the wall was seen through it
    ((15, 0, 0), 0, 0),         # behind the wall: hidden
    ((9.6, 0, 0), 0, 0),        # in front, but within the margin
    ((9.4, 0, 0), 0, 1),        # just outside the margin
    ((-5, 0, 0), 0, 0),         # nothing was measured there
    ((5, 1.5, 0), 0, 1),        # towards the second keypoint
])
def test_one_point_by_hand(wall, point, agree, contradict):
    """Three are asked: the point and the wall's own two, of which one has a partner or none."""
    found = asked(wall, [point], [WALL])
    back = 1 if agree else 0
    assert found.overlap == pytest.approx((agree + back) / 3)
    assert found.violations == pytest.approx(contradict / 3)


def test_a_point_of_another_label_neither_agrees_nor_contradicts(wall):
    """Labels may be wrong: something is there, so the point does not hang in free space."""
    found = asked(wall, [[10.15, 0, 0]], [POLE])
    assert (found.overlap, found.violations) == (0, 0)


@pytest.mark.parametrize(('label', 'wall_label'), [(0, WALL), (WALL, 0), (0, 0)])
def test_what_has_no_label_speaks_by_its_place(label, wall_label):
    """It agrees with whatever is near, and hangs in the air as everything else does."""
    y, z = np.meshgrid(np.arange(-5, 5, 0.05), np.arange(-2, 3, 0.05))
    points = np.c_[np.full(y.size, 10.0), y.ravel(), z.ravel()].astype(np.float32)
    wall = view_of(points, keypoints([[10, 0, 0], [10, 3, 0]], [wall_label] * 2))
    found = asked(wall, [[10.15, 0.2, 0], [5, 0, 0]], [label] * 2)
    assert found.overlap == pytest.approx((1 + 1) / 4)
    assert found.violations == pytest.approx(1 / 4)


def test_shares_by_hand(wall):
    """Six points: two agree, one contradicts; back, both keypoints of the wall agree."""
    points = [[10, 0, 0], [10, 3, 0.5], [4, 0, 0], [15, 0, 0], [-5, 0, 0], [10, 0, 0.2]]
    found = asked(wall, points, [WALL, WALL, WALL, WALL, WALL, POLE])
    assert found.overlap == pytest.approx((2 + 2) / (6 + 2))
    assert found.violations == pytest.approx((1 + 0) / (6 + 2))
    odds = math.exp(-8.34 + 2.85 * math.log(0.5) - 3.34 * math.log(0.125 + 0.005))
    assert found.confidence == pytest.approx(odds / (1 + odds))


def test_a_handful_cannot_make_many_confident(wall):
    """Both points of the wall agree, two of 998 do, nobody contradicts: 4 of 1000."""
    hidden = np.random.default_rng(0).uniform([15, -1, -1], [20, 1, 1], (996, 3))
    many = view_of(NOTHING_SEEN, keypoints([[10, 0, 0.3], [10, 3, 0.3], *hidden], [WALL] * 998))
    for pair in ((many, wall), (wall, many)):
        found = score_pose(*pair, np.eye(4))
        assert found.overlap == pytest.approx(0.004)
        assert found.violations == 0
        assert found.confidence < 0.01


def test_the_transformation_moves_the_source(wall):
    """A quarter turn and a shift bring the point onto the wall, the inverse does not."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('z', 90, degrees=True).as_matrix()
    T[:3, 3] = 6, 0, 0
    assert asked(wall, [[0, -4, 0]], [WALL], T).overlap == pytest.approx(2 / 3)
    assert asked(wall, [[0, -4, 0]], [WALL], np.linalg.inv(T)).overlap == 0


def test_surfaces_are_found_in_every_direction():
    """Any direction across the cells of the hash: what a distance matrix says.

    Across the surface a distance counts in full, along it a tenth of its square.
    """
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-6, 6, (400, 3)), rng.uniform(-6, 6, (300, 3))
    labels_a, labels_b = rng.choice([WALL, POLE], 400), rng.choice([WALL, POLE], 300)
    gap = a[:, None] - b
    squared = (gap**2).sum(axis=-1)
    near = (0.9 * gap[..., 0]**2 + 0.1 * squared <= 0.21**2) & (squared <= REACH**2)
    same = near & (labels_a[:, None] == labels_b)
    found = score_pose(view_of(NOTHING_SEEN, keypoints(a, labels_a)),
                     view_of(NOTHING_SEEN, keypoints(b, labels_b)), np.eye(4))
    agree = same.any(axis=1).sum() + same.any(axis=0).sum()
    assert 20 < agree < 600
    assert found.overlap == pytest.approx(agree / (400 + 300))


def test_no_keypoints_say_nothing(wall):
    found = asked(wall, [], [])
    assert (found.overlap, found.violations, found.confidence) == (0, 0, 0)


@pytest.fixture(scope='module')
def indexes(street):
    return [preprocess(SemanticScan(points, labels)).index for points, labels, _ in street[:2]]


def test_a_scan_agrees_with_itself(indexes):
    found = score_pose(indexes[0], indexes[0], np.eye(4))
    assert found.overlap == pytest.approx(1.0)
    assert found.violations == 0.0
    assert found.confidence > 0.98


def test_right_and_wrong_poses_of_the_street(indexes, street):
    """The truth is believed; turned by 90 degrees or 10 m off nothing is."""
    truth = relative(street[1][2], street[0][2])
    found = score_pose(*indexes, truth)
    assert found.overlap > 0.7
    assert found.confidence > 0.97
    turned, beside, ahead = truth.copy(), truth.copy(), truth.copy()
    turned[:3, :3] = Rotation.from_euler('z', 90, degrees=True).as_matrix() @ truth[:3, :3]
    beside[1, 3] += 10
    ahead[0, 3] += 10
    for wrong in (turned, beside, ahead):
        assert score_pose(*indexes, wrong).confidence < 0.75
    ranks = rough_scores(*indexes, np.array([turned, truth, beside, ahead]))
    assert np.argmax(ranks) == 1


def test_both_directions_say_the_same(indexes, street):
    truth = relative(street[1][2], street[0][2])
    forth = score_pose(*indexes, truth)
    back = score_pose(*indexes[::-1], np.linalg.inv(truth))
    assert forth.overlap == pytest.approx(back.overlap, abs=0.002)
    assert forth.violations == pytest.approx(back.violations, abs=0.002)
