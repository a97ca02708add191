"""Stamps: which scans are late, and when a clock has gone back for good."""
import pytest

from sgor_ros import TrackerConfig
from sgor_ros.tracker.stamps import Arrival
from sgor_ros.tracker.stamps import Stamps

ON_TIME, LATE, ANEW = Arrival.ON_TIME, Arrival.LATE, Arrival.ANEW


def judged(*seconds, **settings):
    stamps, config = Stamps(), TrackerConfig(**settings)
    return [stamps.judge(round(s * 1e9), config) for s in seconds]


@pytest.mark.parametrize('late', [0.0, 5.0, 4.9, 0.001])
def test_one_late_scan_is_late_whatever_its_stamp(late):
    """Zero, twice the same, swapped, or far back: the next goes on."""
    assert judged(4.8, 5.0, late, 5.1, 5.2) == [ON_TIME, ON_TIME, LATE, ON_TIME, ON_TIME]


def test_a_clock_that_is_never_set_is_late_for_ever():
    assert judged(5.0, *[0.0] * 50) == [ON_TIME, *[LATE] * 50]


def test_a_bag_may_begin_at_zero():
    assert judged(0.0, 0.1) == [ON_TIME, ON_TIME]


def test_a_jump_back_needs_two_in_a_row():
    assert judged(5.0, 5.1, 1.0, 1.1, 1.2) == [ON_TIME, ON_TIME, LATE, ANEW, ON_TIME]
    assert judged(5.0, 5.1, 1.0, 5.2, 1.1, 5.3) == [ON_TIME, ON_TIME, LATE, ON_TIME, LATE, ON_TIME]
    assert judged(5.0, 5.1, 2.0, 1.0, 5.2) == [ON_TIME, ON_TIME, LATE, LATE, ON_TIME]
    assert judged(5.0, 5.1, 4.6, 4.7, jump_back=0.3) == [ON_TIME, ON_TIME, LATE, ANEW]


def test_a_burst_of_late_scans_is_dropped():
    """Three that were held up for 0.3 s, in order."""
    assert judged(5.0, 5.4, 5.1, 5.2, 5.3, 5.5) == [ON_TIME, ON_TIME, LATE, LATE, LATE, ON_TIME]


def test_many_late_scans_begin_anew():
    """A bag of half a second, again and again."""
    assert judged(1.0, 1.5, *(0.9 + 0.01 * i for i in range(4)), max_late=4) == [
        ON_TIME, ON_TIME, LATE, LATE, LATE, ANEW]


def test_one_stamp_in_the_future_does_not_end_the_track():
    """The scans after it are not late: it was early."""
    assert judged(5.0, 5.1, 100.0, 5.3, 5.4, 5.5) == [
        ON_TIME, ON_TIME, ON_TIME, LATE, ON_TIME, ON_TIME]
