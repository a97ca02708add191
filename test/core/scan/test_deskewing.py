"""Deskewing against the built-in world's own account of how a sensor moves."""
import numpy as np
import pytest

from sgor_ros import SemanticScan
from sgor_ros.core.common.settings import InputError
from sgor_ros.core.scan.deskewing import deskewed
from sgor_ros.world.motion import unbend

POINTS = np.random.default_rng(0).uniform(-60, 60, (1000, 3)).astype(np.float32)
TIMES = np.random.default_rng(1).uniform(-0.05, 0.1, 1000)


@pytest.mark.parametrize('twist', [
    (20, 1, 0.2, 0.1, -0.2, 1.5), (5, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1), (0,) * 6,
    (3, 4, 5, 1e-12, 0, 0)])
def test_points_lie_where_they_are_seen_at_the_stamp(twist):
    scan = deskewed(SemanticScan(POINTS, np.arange(1000), times=TIMES), np.array(twist, float))
    np.testing.assert_allclose(scan.points, unbend(POINTS, TIMES, twist), atol=2e-5)
    assert scan.times is None
    assert scan.points.dtype == np.float32
    np.testing.assert_array_equal(scan.labels, np.arange(1000))


def test_a_quarter_turn_by_hand():
    """At 2 rad/s a point straight ahead is seen after pi / 4 s: at the stamp it was to the left.
    """
    scan = SemanticScan([[10.0, 0, 0]], times=[np.pi / 4])
    turned = deskewed(scan, np.array([0, 0, 0, 0, 0, 2.0]))
    np.testing.assert_allclose(turned.points, [[0, 10, 0]], atol=1e-5)


def test_without_times_it_is_the_same():
    scan = SemanticScan(POINTS)
    assert deskewed(scan, np.ones(6)) is scan


def test_times_go_with_their_points():
    bad = POINTS.copy()
    bad[::3] = np.nan
    scan = SemanticScan(bad, times=TIMES)
    np.testing.assert_array_equal(scan.times, np.delete(TIMES, np.arange(0, 1000, 3)))
    known = scan.mounted(up=[0, 0, 1])
    np.testing.assert_array_equal(known.times, scan.times)


@pytest.mark.parametrize(('times', 'says'), [
    (TIMES[:-1], r'times: expected shape \(1000,\), got \(999,\)'),
    (np.full(1000, 1.7e9), 'times: 1.7e.09, expected seconds, within 10 of the stamp'),
    (np.where(np.arange(1000) == 7, np.nan, TIMES), 'times: nan, expected seconds')])
def test_what_are_no_times(times, says):
    with pytest.raises(InputError, match=says):
        SemanticScan(POINTS, times=times)
