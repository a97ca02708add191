"""Semantic context: the same from any yaw, another in another place."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SgorConfig
from sgor_ros.core.features.semantic_context import context_classes
from sgor_ros.core.features.semantic_context import OCTAVES
from sgor_ros.core.features.semantic_context import semantic_context
from sgor_ros.core.scan.ground import Ground
from sgor_ros.core.scan.labels import label_convention

CLASSES = context_classes(label_convention('semantickitti'))
BUILDING, VEGETATION, POLE, ROAD, CAR = 13, 15, 18, 9, 1


def place(seed, n=1500):
    """Return keypoints and labels of a place: blocks of houses, trees, poles and cars."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-30, 30, (25, 3)) * [1, 1, 0]
    kind = rng.choice([BUILDING, VEGETATION, POLE, CAR], 25)
    block = rng.integers(25, size=n)
    return (centres[block] + rng.normal(0, 1.5, (n, 3))), kind[block].astype(np.uint8)


def describe(points, labels, R=None):
    """Return the context of points turned by R, and their ground with them."""
    R = np.eye(3) if R is None else R
    ground = Ground(R @ [0, 0, 1.0], 1.7, np.zeros(len(points), bool), 'labels')
    return semantic_context(points @ R.T, labels, ground, CLASSES, SgorConfig())


def parts(context):
    """Return the columns of whatever class, and those of each class."""
    return context[:, :3], context[:, 3:]


def cosine(a, b):
    return np.einsum('ij,ij->i', a, b)


def test_shape_and_unit_rows():
    points, labels = place(0)
    context = describe(points, labels)
    assert OCTAVES == 3
    assert context.shape == (len(points), 3 + 3 * len(CLASSES))
    for part in parts(context):
        np.testing.assert_allclose(np.linalg.norm(part, axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize('turn', [(0.4, 0, 0), (2.5, 0, 0), (1.0, 0.3, -0.2), (-2, 3.0, 0.1)])
def test_yaw_and_mounting_change_next_to_nothing(turn):
    """About the ground normal, and with a sensor that is tilted or upside down."""
    points, labels = place(0)
    plain_any, plain = parts(describe(points, labels))
    turned_any, turned = parts(describe(points, labels,
                                        Rotation.from_euler('zyx', turn).as_matrix()))
    assert np.median(cosine(plain_any, turned_any)) > 0.97
    same = cosine(plain, turned)
    assert np.median(same) > 0.97
    # a stranger's context is not as near: 9 of 10 points know themselves among 30
    others = np.random.default_rng(1).integers(len(points), size=(len(points), 30))
    far = np.linalg.norm(points[others] - points[:, None], axis=2) > 5
    strangers = np.einsum('ij,ikj->ik', turned, plain[others])
    assert ((strangers < same[:, None]) | ~far).all(axis=1).mean() > 0.9


def test_places_differ():
    """The same class in another place has another context."""
    (points, labels), (points_b, labels_b) = place(0), place(5)
    a, b = parts(describe(points, labels))[1], parts(describe(points_b, labels_b))[1]
    for kind in (BUILDING, VEGETATION):
        between = a[labels == kind] @ b[labels_b == kind].T
        assert np.median(between) < 0.9


def test_only_present_classes_have_columns():
    """A pole and a house 4 m away: nothing in any other column; each sees itself most."""
    context = describe(np.array([[0, 0, 0], [4, 0, 0.0]]), np.array([POLE, BUILDING], np.uint8))
    by_class = context[:, 3:].reshape(2, len(CLASSES), 3)
    used = by_class.any(axis=(0, 2))
    assert {CLASSES[i] for i in np.flatnonzero(used)} == {POLE, BUILDING}
    finest = by_class[:, :, 0]
    assert finest[0, CLASSES.index(POLE)] > finest[0, CLASSES.index(BUILDING)]
    assert finest[1, CLASSES.index(BUILDING)] > finest[1, CLASSES.index(POLE)]


def test_rows_are_zero_where_nothing_stands_around():
    """Ground and movers have no map: alone they see no class; near a house they see it."""
    moving = 22
    points = np.array([[0, 0, 0], [200, 0, 0], [202, 0, 0.0]])
    context = describe(points, np.array([moving, moving, BUILDING], np.uint8))
    whatever, by_class = parts(context)
    assert not by_class[0].any()
    assert by_class[1].any()
    np.testing.assert_allclose(np.linalg.norm(whatever, axis=1), 1.0, atol=1e-5)
    assert ROAD not in CLASSES
    assert moving not in CLASSES


def test_octaves_of_a_lone_point_by_hand():
    """A blurred point is 1 / sigma high where it stands, weighed: its root falls by sqrt(2)."""
    whatever, by_class = parts(describe(np.zeros((1, 3)), np.array([BUILDING], np.uint8)))
    expected = np.array([1, 0.5**0.5, 0.5]) / 1.75**0.5
    np.testing.assert_allclose(whatever[0], expected, atol=0.01)
    at = 3 * CLASSES.index(BUILDING)
    np.testing.assert_allclose(by_class[0, at:at + 3], expected, atol=0.01)


def test_whatever_class_does_not_depend_on_labels():
    """Other labels, those without a map included: the first columns stay."""
    points, labels = place(3)
    other = np.random.default_rng(0).permutation(labels)
    other[::5] = ROAD
    (whatever, by_class), (whatever_other, by_class_other) = (
        parts(describe(points, some)) for some in (labels, other))
    np.testing.assert_array_equal(whatever, whatever_other)
    assert np.median(cosine(by_class, by_class_other)) < 0.9


def test_no_keypoints():
    assert describe(np.empty((0, 3)), np.empty(0, np.uint8)).shape == (0, 3 + 3 * len(CLASSES))


def test_heights_do_not_matter():
    """The maps are seen from above."""
    points, labels = place(2)
    lifted = points + np.random.default_rng(0).uniform(0, 5, (len(points), 1)) * [0, 0, 1]
    np.testing.assert_allclose(describe(points, labels), describe(lifted, labels), atol=1e-6)
