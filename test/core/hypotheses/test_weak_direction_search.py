"""Along weak directions step by step: which steps are asked, and which poses come of them."""
from galleries import gallery
from galleries import index_of
from galleries import moved
from galleries import NOTHING
import numpy as np
import pytest

from sgor_ros.core.hypotheses import weak_direction_search as search_module
from sgor_ros.core.hypotheses.weak_direction_search import _peaks
from sgor_ros.core.hypotheses.weak_direction_search import _score
from sgor_ros.core.hypotheses.weak_direction_search import _tuned
from sgor_ros.core.hypotheses.weak_direction_search import search_weak_directions
from sgor_ros.core.scoring.pose_scoring import score_keypoints

ALONG_X = np.array([[1.0, 0, 0, 0, 0, 0]])


@pytest.fixture(scope='module')
def pillars():
    return index_of(*gallery(pitch=8.0))


@pytest.fixture(scope='module')
def bare():
    return index_of(*gallery(pitch=0.0))


def test_a_violation_weighs_five_agreements():
    outcomes = np.array([[1, 1, 1, 0, -1], [1, 1, 1, 1, 1], [-1, -1, 0, 0, 0]], np.int8)
    np.testing.assert_array_equal(_score(outcomes), [3 - 5, 5, -10])


def test_peaks_are_the_best_steps_and_none_is_next_to_a_better():
    score = np.array([5.0, 9, 8, 7, -1, 0, 3, 3, 6])
    assert _peaks(score, 9) == [1, 3, 8, 6]
    assert _peaks(score, 2) == [1, 3]
    assert _peaks(np.array([4.0, 3, 2]), 9) == [0, 2]
    assert _peaks(np.array([0.0, -1, 0]), 9) == []
    assert _peaks(np.array([1.0, 0, 0.5]), 9) == [0, 2]
    np.testing.assert_array_equal(score, [5, 9, 8, 7, -1, 0, 3, 3, 6])


@pytest.mark.parametrize(('off', 'left'), [(0.3, 0.0), (-0.3, -0.15), (0.15, 0.15),
                                           (-0.15, -0.15), (0.0, 0.0), (0.6, 0.3), (8.3, 8.0),
                                           (-0.6, -0.3)])
def test_poses_are_tuned_by_half_a_maximum_distance_at_most(pillars, off, left):
    """By a quarter or half of 0.6 m, to the first of what fits best: 0.2 m off nothing is."""
    found = _tuned(pillars, pillars, np.array([moved(off), moved(off, 0, 0, 180)]), ALONG_X)
    assert found.shape == (2, 4, 4)
    assert found[0, 0, 3] == pytest.approx(left)
    np.testing.assert_array_equal(found[0, :3, :3], np.eye(3))
    np.testing.assert_allclose(found[1, :3, :3], moved(yaw_deg=180)[:3, :3])


def test_each_weak_direction_is_tuned_along(pillars):
    """Across too: the walls say where."""
    both = np.array([[0.0, 1, 0, 0, 0, 0], *ALONG_X])
    assert _tuned(pillars, pillars, moved(0.3)[None], both)[0, 0, 3] == pytest.approx(0)
    assert _tuned(pillars, pillars, moved(0, 0.3)[None], both)[0, 1, 3] == pytest.approx(0)
    assert _tuned(pillars, pillars, NOTHING, both).shape == (0, 4, 4)


def test_pillars_are_found_at_their_pitch_up_to_the_radius(pillars):
    """Both ways; nearer than two maximum distances the pushes decide, and the radius is the end.
    """
    found = search_weak_directions(pillars, pillars, np.eye(4), NOTHING, ALONG_X, 30.0)
    shifts = found[:, 0, 3]
    for shift in (-16, -8, 8, 16):
        assert np.abs(shifts - shift).min() < 0.25
    assert np.abs(shifts).min() > 1.2
    assert np.abs(shifts).max() < 30.0
    np.testing.assert_allclose(found[:, 1:3, 3], 0, atol=1e-12)
    near = search_weak_directions(pillars, pillars, np.eye(4), NOTHING, ALONG_X, 10.0)[:, 0, 3]
    assert np.abs(near).max() < 10.0
    for shift in (-8, 8):
        assert np.abs(near - shift).min() < 0.25


@pytest.mark.parametrize('away', [5.0, -5.0])
def test_steps_reach_the_radius_both_ways(away):
    """A pillar that stands once, 5 m from where it is laid now; up to 5.4 m it is found."""
    once = index_of(*gallery(pitch=200.0, offset=3.0))
    found = search_weak_directions(once, once, moved(away), NOTHING, ALONG_X, 5.4)
    assert np.abs(found[:, 0, 3]).min() < 0.25
    near = search_weak_directions(once, once, moved(away), NOTHING, ALONG_X, 4.0)
    assert np.abs(near[:, 0, 3]).min() > 0.9


def test_a_turn_of_the_others_is_followed_from_the_best_of_them(bare):
    """Half a turn among the others, given twice: from the one that explains more it goes on."""
    others = np.array([moved(20, 0, 0, 180), moved(0.5, 0, 0, 180), moved(0, 30)])
    found = search_weak_directions(bare, bare, np.eye(4), others, ALONG_X, 30.0)
    turned = found[found[:, 0, 0] < 0]
    assert len(turned) > 8
    assert turned[2:, 0, 3].min() < -5
    assert turned[2:, 0, 3].max() > 2.5
    np.testing.assert_allclose(turned[:, 1, 3], 0, atol=1e-9)
    # what explains less than 45 % of the answer is left out, and so is its turn
    assert not (np.abs(found[:, 1, 3] - 30) < 1).any()
    quarter = search_weak_directions(bare, bare, np.eye(4), moved(0, 0, 0, 90)[None], ALONG_X,
                                     30.0)
    assert (quarter[:, 0, 0] > 0.9).all()


def test_turns_are_told_apart_by_quarters():
    """In a round shaft all stand: 40 degrees are followed with none, 50 with a quarter."""
    angle, z = np.meshgrid(np.arange(0, 2 * np.pi, 0.05), np.arange(-3, 3.1, 0.5))
    out = np.stack((np.cos(angle), np.sin(angle), 0 * z), -1).reshape(-1, 3)
    shaft = index_of(8 * out + np.c_[0 * z.ravel(), 0 * z.ravel(), z.ravel()], -out)
    about_z = np.array([[0, 0, 0, 0, 0, 0.12]])
    counts = [len(search_weak_directions(shaft, shaft, np.eye(4), moved(yaw_deg=yaw)[None],
                                         about_z, 30.0)) for yaw in (40, 50)]
    assert counts[0] <= 9 < counts[1]


def test_the_others_that_stand_are_kept_themselves(pillars):
    """Tuned, where they are farther off than a push and nearer than the radius."""
    others = np.array([moved(8.15), moved(0.9), moved(31.0)])
    found = search_weak_directions(pillars, pillars, np.eye(4), others, 0 * ALONG_X[:0], 30.0)
    np.testing.assert_allclose(found[:, 0, 3], [8.15])
    found = search_weak_directions(pillars, pillars, np.eye(4), others, ALONG_X, 30.0)
    assert abs(found[0, 0, 3] - 8.0) < 0.2


def test_distances_are_from_the_answer_and_not_from_the_target(pillars):
    T = moved(16.0)
    found = search_weak_directions(pillars, pillars, T, NOTHING, ALONG_X, 10.0)
    shifts = found[:, 0, 3] - 16.0
    assert np.abs(shifts).max() < 10.0
    for shift in (-8, 8):
        assert np.abs(shifts - shift).min() < 0.25


def test_the_search_covers_the_radius_both_ways(bare, monkeypatch):
    """Step by step, a maximum distance each, from one end to the other."""
    asked = []

    def scored(source, target, T_target_source, keypoints):
        asked.append(np.array(T_target_source))
        return score_keypoints(source, target, T_target_source, keypoints)
    monkeypatch.setattr(search_module, 'score_keypoints', scored)
    search_weak_directions(bare, bare, np.eye(4), NOTHING, ALONG_X, 12.2)
    steps = asked[1][:, 0, 3]
    np.testing.assert_allclose(np.diff(steps), bare.max_distance)
    assert steps[0] == pytest.approx(-12.2)
    assert 12.2 <= steps[-1] < 12.2 + bare.max_distance
