"""Keyframes: bounded in number, spread over the way, each tried in its turn."""
import numpy as np

from sgor_ros.core.common import se3
from sgor_ros.tracker.keyframes import Keyframe
from sgor_ros.tracker.keyframes import Keyframes


def keyframe(stamp_ns, x=0.0, track_id=1):
    """Return one at a place; whoever holds it needs no scan."""
    T = se3.compose(np.eye(3), np.array([x, 0.0, 0.0]))
    return Keyframe(stamp_ns, None, stamp_ns, track_id, T, None)


def along(count, limit):
    keyframes = Keyframes()
    for k in range(count):
        keyframes.add(keyframe(k, 5.0 * k), limit)
        assert len(keyframes) <= limit
    return keyframes


def everything(keyframes):
    return sorted(one.stamp_ns for one in keyframes.in_turns(1000, keyframe(-1)))


def test_a_long_way_leaves_keyframes_all_along_it():
    """The first and the last three are there, and no gap is much longer than a fair share."""
    kept = everything(along(1000, limit=10))
    assert len(kept) == 10
    assert kept[0] == 0
    assert kept[-3:] == [997, 998, 999]
    assert np.diff(kept).max() <= 2 * 1000 / 7


def test_rounds_of_the_same_way_do_not_push_out_other_places():
    """Once to a far place, then a hundred times around the start."""
    keyframes = Keyframes()
    for k, x in enumerate((0.0, 100.0, 200.0, 100.0)):
        keyframes.add(keyframe(k, x), 6)
    for k in range(4, 400):
        keyframes.add(keyframe(k, 5.0 * (k % 4)), 6)
    assert 2 in everything(keyframes)


def test_one_of_an_earlier_track_is_not_near_to_any():
    keyframes = Keyframes()
    keyframes.add(keyframe(0, 0.0, track_id=1), 5)
    for k in range(1, 100):
        keyframes.add(keyframe(k, 0.0, track_id=2), 5)
    assert 0 in everything(keyframes)
    assert keyframes.last(1).stamp_ns == 0
    assert keyframes.last(2).stamp_ns == 99
    assert keyframes.last(3) is None


def test_each_has_its_turn_but_the_one_that_has_been_tried():
    keyframes = along(6, limit=10)
    tried = [one.stamp_ns for _ in range(5) for one in keyframes.in_turns(2, keyframe(5))]
    assert tried == [4, 3, 2, 1, 0, 4, 3, 2, 1, 0]
    assert keyframes.in_turns(0, keyframe(5)) == []


def test_only_earlier_tracks_are_asked_for_where_only_they_are_wanted():
    keyframes = Keyframes()
    for k, track_id in enumerate((1, 2, 3)):
        keyframes.add(keyframe(k, 0.0, track_id), 10)
    assert [one.stamp_ns for one in keyframes.in_turns(5, keyframe(9), before_track=3)] == [1, 0]
    assert keyframes.in_turns(5, keyframe(9), before_track=1) == []


def test_one_is_not_kept_twice():
    keyframes = along(3, limit=10)
    keyframes.keep(keyframe(2, 10.0), 10)
    keyframes.keep(keyframe(7, 35.0), 10)
    assert everything(keyframes) == [0, 1, 2, 7]
