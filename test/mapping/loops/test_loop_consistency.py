"""Which loops are believed: two rows of nodes, and loops between them that are right or not."""
import numpy as np
import pytest

from sgor_ros.core.common import se3
from sgor_ros.mapping.config import MapperConfig
from sgor_ros.mapping.edge import Edge
from sgor_ros.mapping.edge import Kind
from sgor_ros.mapping.loops.loop_consistency import LoopConsistency
from sgor_ros.mapping.loops.paths import Paths

CONFIG = MapperConfig()
SURE = np.diag([0.01**2] * 3 + [0.001**2] * 3)
UNSURE = np.diag([5.0**2] * 3 + [0.1**2] * 3)


def shift(*xyz):
    return se3.compose(np.eye(3), np.array(xyz, float))


def street(gap=None):
    """Return nodes 0 to 9 along x, and 20 to 29 the same way again, joined by one edge or none."""
    consistency = LoopConsistency()
    for first in (0, 20):
        for i in range(9):
            consistency.paths.add(Edge(first + i, first + i + 1, shift(5, 0, 0), SURE))
    if gap is not None:
        consistency.paths.add(Edge(9, 20, shift(-45, 0, 0), gap))
    return consistency


def loop(target, source, x=0.0, covariance=SURE):
    """Return a loop that is wrong by x metres."""
    T = shift(5 * (source - 20 - target) + x, 0, 0)
    return Edge(target, source, T, covariance, Kind.LOOP)


def test_a_loop_that_odometry_agrees_with_is_believed():
    consistency, right = street(SURE), loop(3, 22)
    assert consistency.offer(right, CONFIG) == [right]
    assert not consistency.waiting


def test_a_loop_that_odometry_contradicts_is_not():
    """14 edges of 1 cm: 4 sigma and more are 0.2 m."""
    consistency = street(SURE)
    assert consistency.offer(loop(3, 22, 0.4), CONFIG) == []
    assert consistency.contradicted == 1
    assert not consistency.waiting


@pytest.mark.parametrize('gap', [UNSURE, None])
def test_where_odometry_says_little_two_have_to_agree(gap):
    consistency, one, other = street(gap), loop(3, 22), loop(4, 24)
    assert consistency.offer(one, CONFIG) == []
    assert set(consistency.offer(other, CONFIG)) == {one, other}
    assert not consistency.waiting
    # and now that there is a way, it is sure enough for the next alone
    third = loop(8, 27)
    assert consistency.offer(third, CONFIG) == [third]
    assert consistency.offer(loop(8, 27, 0.4), CONFIG) == []


@pytest.mark.parametrize('gap', [UNSURE, None])
def test_loops_that_contradict_each_other_wait_until_more_agree(gap):
    """Rows of houses that repeat after 5 m: what is off by that is off alone."""
    consistency = street(gap)
    assert consistency.offer(loop(3, 22, 5), CONFIG) == []
    assert consistency.offer(loop(4, 23), CONFIG) == []
    assert consistency.offer(loop(5, 24, -5), CONFIG) == []
    assert consistency.offer(loop(6, 25), CONFIG) == []    # one agrees, two do not
    assert consistency.offer(loop(2, 26), CONFIG) == []    # two and two
    assert len(consistency.offer(loop(2, 27), CONFIG)) == 4
    assert len(consistency.waiting) == 2


def test_the_same_scan_may_agree_with_two_keyframes():
    consistency, one, other = street(), loop(3, 22), loop(4, 22)
    assert consistency.offer(one, CONFIG) == []
    assert set(consistency.offer(other, CONFIG)) == {one, other}


def test_right_loops_put_a_false_one_in_question():
    consistency = street(UNSURE)
    false = [loop(3, 22, 2), loop(4, 23, 2)]
    for one in false:
        believed = consistency.offer(one, CONFIG)
    assert set(believed) == set(false)
    right = [loop(1, 24), loop(5, 25), loop(6, 26), loop(7, 27)]
    for one in right:
        assert not consistency.in_question()
        assert consistency.offer(one, CONFIG) == []
    assert consistency.in_question()
    assert consistency.contradicting == right


def test_the_surest_way_is_taken():
    paths = Paths()
    paths.add(Edge(0, 1, shift(1, 0, 0), 100 * SURE))
    paths.add(Edge(0, 2, shift(0, 1, 0), SURE))
    paths.add(Edge(2, 1, shift(1.1, -1, 0), SURE))
    T, covariance = paths.between(0, 1)
    np.testing.assert_allclose(T, shift(1.1, 0, 0), atol=1e-12)
    # two edges, and the turn of the first by a lever of 1.5 m
    assert covariance[1, 1] == pytest.approx(2 * 0.01**2 + (1.1 * 0.001)**2)
    np.testing.assert_allclose(paths.between(1, 0)[0], shift(-1.1, 0, 0), atol=1e-12)
    paths.add(Edge(1, 0, shift(-1.05, 0, 0), SURE / 4))    # a surer one, the other way round
    np.testing.assert_allclose(paths.between(0, 1)[0], shift(1.05, 0, 0), atol=1e-12)
    paths.add(Edge(0, 1, shift(9, 0, 0), SURE))    # a less sure one changes nothing
    np.testing.assert_allclose(paths.between(0, 1)[0], shift(1.05, 0, 0), atol=1e-12)
    assert paths.between(0, 7) is None
