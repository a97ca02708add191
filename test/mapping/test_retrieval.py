"""What looks alike: the same place turned, and not another."""
import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import SemanticScan
from sgor_ros.core.common import se3
from sgor_ros.mapping.keyframe import Keyframes
from sgor_ros.mapping.retrieval import describe
from sgor_ros.mapping.retrieval import FEW
from sgor_ros.mapping.retrieval import Retrieval


def prepared(scan, yaw=0.0, labelled=True):
    points, labels, _ = scan
    turned = points @ se3.rotations(np.array([0, 0, yaw])).T
    return preprocess(SemanticScan(turned, labels if labelled else None))


@pytest.fixture(scope='module')
def descriptors(street, elsewhere):
    return np.array([describe(prepared(scan)) for scan in (*street, *elsewhere)])


@pytest.mark.parametrize('yaw', [0.7, 2.0, np.pi, -1.1])
def test_a_turn_changes_little(street, descriptors, yaw):
    likeness = descriptors @ describe(prepared(street[0], yaw))
    assert np.argmax(likeness) == 0
    assert likeness[0] > 0.97
    # farther along the street it looks less and less the same, elsewhere still less
    assert likeness[0] > likeness[1] > likeness[3] > likeness[4:].max()


@pytest.mark.parametrize('yaw', [0.0, 2.0])
def test_without_labels_too(street, descriptors, elsewhere, yaw):
    places = np.array([describe(prepared(scan, labelled=False)) for scan in (*street, *elsewhere)])
    likeness = places @ describe(prepared(street[1], yaw, labelled=False))
    assert np.argmax(likeness) == 1
    assert likeness[1] > 0.96
    # half of the other's is about labels
    assert descriptors[1] @ places[1] == pytest.approx(np.sqrt(0.5), abs=0.1)


def test_the_most_alike_come_first_also_when_rows_have_grown():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(200, 30)).astype(np.float32)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    retrieval = Retrieval()
    assert retrieval.alike(rows[0]) == {}
    for i, row in enumerate(rows):
        retrieval.add(1000 + i, row)
    alike = retrieval.alike(rows[70] + 0.1 * rows[150])
    order = list(alike)
    assert list(alike.values()) == sorted(alike.values(), reverse=True)
    assert order[0] == 1070
    assert sorted(order) == list(range(1000, 1200))


def test_of_many_the_same_are_found_by_a_shortlist(descriptors):
    """Mixtures of real descriptors; also of rows that came after the axes."""
    rng = np.random.default_rng(0)
    share = rng.uniform(0, 1, (6000, len(descriptors))) ** 4
    noise = rng.normal(0, 0.3, (6000, descriptors.shape[1]))
    rows = (share @ descriptors * np.exp(noise)).astype(np.float32)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    retrieval = Retrieval()
    for i, row in enumerate(rows):
        retrieval.add(i, row)
        if i == FEW:
            retrieval.alike(row, 10)
    for i in (3, 2000, 5999):
        asked = rows[i] + 0.3 * rows[i - 1]
        all_of_them, few = retrieval.alike(asked), retrieval.alike(asked, 20)
        assert len(all_of_them) == 6000
        assert len(few) == 20
        assert next(iter(few)) == next(iter(all_of_them)) == i
        assert len(set(few) & set(list(all_of_them)[:20])) >= 15
        assert few[i] == pytest.approx(all_of_them[i], abs=1e-6)


def test_a_kept_keyframe_registers_like_the_scan(street):
    """Restored after others were asked for, it looks as it did."""
    keyframes = Keyframes()
    scans = [prepared(scan) for scan in (*street, *street[:2])]
    for node, scan in enumerate(scans):
        keyframes.add(node, node, 1, scan)
    assert 5e4 < keyframes.nbytes / len(keyframes) < 1e6
    for node in range(len(scans)):
        np.testing.assert_array_equal(keyframes.restored(node).features.points,
                                      scans[node].features.points)
    np.testing.assert_allclose(describe(keyframes.restored(0)), keyframes[0].descriptor,
                               atol=1e-6)
    assert next(iter(keyframes.alike(scans[2]))) == 2
