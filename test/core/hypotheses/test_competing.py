"""The poses that compete with one, on galleries made by hand: how many, how far, which way."""
from galleries import gallery
from galleries import index_of
from galleries import moved
from galleries import NOTHING
from galleries import UP
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SgorConfig
from sgor_ros.core.degeneracy.directions import DegenerateDirection
from sgor_ros.core.hypotheses.competing import _candidates
from sgor_ros.core.hypotheses.competing import _distinct
from sgor_ros.core.hypotheses.competing import alone
from sgor_ros.core.hypotheses.competing import compete
from sgor_ros.core.hypotheses.competing import hypothesis_test
from sgor_ros.core.icp.point_to_plane import icp
from sgor_ros.core.scoring.pose_scoring import pose_score
from sgor_ros.core.scoring.pose_scoring import score_keypoints

ALONG_X = np.array([1.0, 0, 0, 0, 0, 0])
NOT_WEAK = np.empty((0, 6))


@pytest.fixture(scope='module')
def bare():
    return index_of(*gallery(pitch=0.0))


@pytest.fixture(scope='module')
def pillars():
    """Return pillars each 8 m on one side: the same again 8 m on, and not turned round."""
    return index_of(*gallery(pitch=8.0))


@pytest.fixture(scope='module')
def once():
    return index_of(*gallery(pitch=200.0, offset=3.0))


def tube(up=UP):
    """Return a square tube, alike under quarter turns about its axis, with steps at three places.
    """
    points, normals = [], []
    across = np.arange(-3.75, 4, 0.5)
    for quarter in range(4):
        R = moved(roll_deg=90.0 * quarter)[:3, :3]
        parts = [(np.arange(-20, 20, 0.5), [-4.0], UP)]
        parts += [([x], [-3.75, -3.25], [facing, 0, 0])
                  for x, facing in ((-7.0, 1.0), (2.0, -1.0), (11.0, -1.0))]
        for x, z, normal in parts:
            side = np.stack(np.meshgrid(x, across, z), -1).reshape(-1, 3)
            points.append(side @ R.T)
            normals.append(np.tile(R @ normal, (len(side), 1)))
    return index_of(np.concatenate(points), np.concatenate(normals), up=up)


def scattered(seed):
    """Return walls of points anywhere, and at -6 and 9 m along them few that face along them."""
    rng, n, m = np.random.default_rng(seed), 3000, 360
    y = rng.choice([-4.0, 4.0], n)
    walls = np.stack((rng.uniform(-20, 20, n), y, rng.uniform(-1.5, 3, n)), -1)
    facing = np.stack((np.where(rng.random(m) < 0.5, -6.0, 9.0),
                       rng.choice([-1, 1], m) * rng.uniform(2.5, 4, m), rng.uniform(-1.5, 3, m)),
                      -1)
    across = np.stack((0 * y, -np.sign(y), 0 * y), -1)
    return index_of(np.concatenate((walls, facing)),
                    np.concatenate((across, np.tile([1.0, 0, 0], (m, 1)))))


def along(test):
    """Return how far along x the competing poses lie from the answer, sorted, metres."""
    return np.sort(test.competing[:, 0, 3] - test.T_target_source[0, 3])


def straight(poses):
    return np.abs(poses[:, 0, 0] - 1) < 1e-3


@pytest.mark.parametrize(('pitch', 'shifts'), [
    (8.0, [-24, -16, -8, 8, 16, 24]), (5.0, [*range(-30, 0, 5), *range(5, 31, 5)])])
def test_pillars_compete_one_pitch_apart_along_the_gallery(pitch, shifts):
    """All within the radius, where they belong, nothing turned: 50 of 80 m agree 30 m on."""
    index = index_of(*gallery(pitch=pitch))
    found = hypothesis_test(index, index, np.eye(4), NOTHING, 30.0)
    np.testing.assert_allclose(found.T_target_source, np.eye(4), atol=1e-3)
    np.testing.assert_allclose(along(found), shifts, atol=0.01)
    np.testing.assert_allclose(found.competing[:, 1:3, 3], 0, atol=0.01)
    np.testing.assert_allclose(found.competing[:, :3, :3] - np.eye(3), 0, atol=1e-3)
    # the best first: what is nearer overlaps more
    assert (np.diff(np.abs(found.competing[:, 0, 3])) > -0.01).all()
    assert found.degenerate == ()
    assert not found.weak
    np.testing.assert_array_equal(found.outcomes, score_keypoints(
        index, index, found.T_target_source[None], 1000)[0])
    np.testing.assert_array_equal(found.competing_outcomes, score_keypoints(
        index, index, found.competing, 1000))


def test_others_are_looked_for_within_the_radius():
    """Pillars each 5 m: of those 5 and 10 m away only the nearer ones, from 7 m on."""
    index = index_of(*gallery(pitch=5.0))
    found = hypothesis_test(index, index, np.eye(4), NOTHING, 7.0)
    np.testing.assert_allclose(along(found), [-5, 5], atol=0.01)


def test_bare_walls_slide_and_look_the_same_from_behind(bare):
    """One free direction, along them and without end; half a turn is the only other pose."""
    found = hypothesis_test(bare, bare, np.eye(4), NOTHING, 30.0)
    direction, = found.degenerate
    np.testing.assert_allclose(np.abs(direction.twist), ALONG_X, atol=1e-3)
    assert direction.sigma == pytest.approx(30 / np.sqrt(3))
    assert direction.lever == pytest.approx(23.5, abs=0.1)
    assert found.weak
    turned, = found.competing
    np.testing.assert_allclose(turned[:2, :2], -np.eye(2), atol=1e-3)
    np.testing.assert_allclose(turned[1:3, 3], 0, atol=0.01)


def test_what_stands_once_leaves_one_pose(once):
    """The walls hardly hold it, the one pillar does: tried, and neither sliding nor ambiguous."""
    found = hypothesis_test(once, once, np.eye(4), NOTHING, 30.0)
    assert found.weak
    assert found.degenerate == ()
    assert found.competing.shape == (0, 4, 4)
    assert found.competing_outcomes.shape == (0, 2000)
    np.testing.assert_allclose(found.T_target_source, np.eye(4), atol=1e-3)


def test_at_the_end_of_a_gallery_one_way_is_enough_to_slide():
    """A wall across at 40 m stops it one way only while the other scan saw no wall."""
    points, normals = gallery(pitch=0.0)
    y, z = np.meshgrid(np.arange(-3.75, 4, 0.5), np.arange(-1.5, 3, 0.5))
    end = np.stack((np.full(y.size, 40.0), y.ravel(), z.ravel()), -1)
    closed = index_of(np.concatenate((points, end)),
                      np.concatenate((normals, np.tile([-1.0, 0, 0], (len(end), 1)))))
    direction, = hypothesis_test(index_of(points, normals), closed, np.eye(4), NOTHING, 30.0
                                 ).degenerate
    np.testing.assert_allclose(np.abs(direction.twist), ALONG_X, atol=1e-3)


def test_a_better_pose_among_the_hypotheses_wins_and_is_tested_in_turn(pillars):
    """From half a pitch off: the answer, and those that compete with it and not with the start."""
    found = hypothesis_test(pillars, pillars, moved(4.0), moved()[None], 30.0)
    np.testing.assert_allclose(found.T_target_source, np.eye(4), atol=1e-3)
    np.testing.assert_allclose(along(found), [-24, -16, -8, 8, 16, 24], atol=0.01)
    assert not found.weak, 'that of the answer'
    np.testing.assert_array_equal(found.outcomes, score_keypoints(
        pillars, pillars, found.T_target_source[None], 1000)[0])


def test_the_winner_is_tested_once(pillars):
    first = hypothesis_test(pillars, pillars, moved(4.0), moved()[None], 30.0, again=False)
    np.testing.assert_allclose(first.T_target_source, np.eye(4), atol=1e-3)
    assert first.weak, 'that of the start'


def test_a_pose_on_its_way_arrives_before_it_competes():
    """Half a turn fits 3 m on; the first rounds leave it 0.2 m short, where little pulls.

    Straight on, what stands at 9 m fits what stands at -6 m, and the other way round.
    """
    source, target = scattered(0), scattered(1)
    found = hypothesis_test(source, target, np.eye(4), NOTHING, 30.0)
    assert not found.weak
    turned, *others = found.competing
    np.testing.assert_allclose(np.sort([T[0, 3] for T in others]), [-15, 15], atol=0.04)
    np.testing.assert_allclose([T[:2, :2] for T in others], [np.eye(2)] * 2, atol=5e-3)
    np.testing.assert_allclose(turned[:2, :2], -np.eye(2), atol=5e-3)
    np.testing.assert_allclose(turned[:2, 3], [3.0, 0.0], atol=0.04)
    np.testing.assert_array_equal(found.competing_outcomes[0], score_keypoints(
        source, target, turned[None], 1000)[0])


@pytest.mark.parametrize('start', [moved(0, 3.0), moved(0, 0, 30.0), moved(500)])
def test_a_pose_that_nothing_explains_stays_where_it_is_and_unsupported(bare, start):
    """Far away: nothing to fit to, nothing in its favour.

    Beside the walls and above them a search in all directions, for nothing holds any, meets them.
    """
    found = hypothesis_test(bare, bare, start, NOTHING, 30.0)
    score = pose_score(found.outcomes)
    if start[0, 3] == 0.0:
        # walls hold no height: they explain each other with a metre of 4.5 missing, too
        assert score.overlap >= (1.0 if start[2, 3] == 0.0 else 0.77)
        np.testing.assert_allclose(found.T_target_source[1, 3], 0, atol=0.01)
        assert abs(found.T_target_source[2, 3]) < (0.01 if start[2, 3] == 0.0 else 1.0)
    else:
        np.testing.assert_array_equal(found.T_target_source, start)
        assert score.overlap == 0.0
        assert score.confidence == 0.0


def test_level_poses_only_where_both_see_the_ground():
    """A square tube fits itself under quarter turns about its axis, but for what is up."""
    rolls = np.array([moved(roll_deg=angle) for angle in (90, 180, 270)])
    level, free = tube(), tube(up=None)
    for source, target, count in ((level, level, 0), (level, free, 3), (free, free, 3)):
        found = hypothesis_test(source, target, np.eye(4), rolls, 30.0)
        rolled = found.competing[found.competing[:, 2, 2] < 0.5]
        assert len(rolled) == count
        np.testing.assert_allclose(rolled[:, :3, 3], 0, atol=0.01)
    # a level target takes poses that are rolled for the same as others that are not
    found = _candidates(free, level, np.eye(4), moved(9, roll_deg=90)[None], NOT_WEAK, 30.0)
    assert (found[:, 2, 2] < 0.5).any()


def test_without_the_ground_check_what_is_up_may_be_a_wall():
    rolls = np.array([moved(roll_deg=angle) for angle in (90, 180, 270)])
    level = tube()
    for check, count in ((True, 0), (False, 3)):
        found = compete(level, level, np.eye(4), rolls, SgorConfig(ground_check=check))
        assert (found.competing[:, 2, 2] < 0.5).sum() == count


@pytest.mark.parametrize(('degrees', 'kept'), [(9.5, True), (10.5, False)])
def test_a_pose_is_level_within_ten_degrees(bare, degrees, kept):
    """Of the ground normals: a candidate far from any point stays as it was given."""
    tilted = moved(300.0, roll_deg=degrees)
    found = _candidates(bare, bare, np.eye(4), tilted[None], NOT_WEAK, 30.0)
    assert (found[:, 0, 3] == 300.0).sum() == kept
    # and so where the ground of one lies across
    up = Rotation.from_euler('x', degrees, degrees=True).apply(UP)
    askew = index_of(*gallery(pitch=0.0), up=up)
    for pair in ((askew, bare), (bare, askew)):
        found = _candidates(*pair, np.eye(4), moved(300.0)[None], NOT_WEAK, 30.0)
        assert (found[:, 0, 3] == 300.0).sum() == kept


def test_candidates_are_six_of_the_solver_and_those_of_the_maps(once):
    """Those that differ, the first six; then peaks of the maps, roughly fitted."""
    hypotheses = np.array([moved(100.0 * k) for k in (0, 1, 1, 2, 3, 4, 5, 6, 7, 8)])
    found = _candidates(once, once, np.eye(4), hypotheses, NOT_WEAK, 30.0)
    assert found[:6, 0, 3].tolist() == [100, 200, 300, 400, 500, 600]
    assert (found[6:, 0, 3] < 40).all()
    assert len(found) == 6 + 30
    # beside the answer is on the answer after three rounds of those up to twice the distance
    start = moved(1.0)
    found = _candidates(once, once, moved(30.0), start[None], NOT_WEAK, 30.0)
    np.testing.assert_array_equal(found[0], icp(once, once, start[None], 3, 0, 125)[0])


def test_along_weak_directions_the_search_goes_on_step_by_step(bare):
    """Every kind of pose but those that a push finds: two maximum distances and more away."""
    found = _candidates(bare, bare, np.eye(4), NOTHING, ALONG_X[None], 30.0)
    far = np.abs(found[straight(found), 0, 3])
    assert len(far) >= 8
    assert far.min() > 1.2
    assert far.max() < 30.0
    assert {-1, 1} == set(np.sign(found[straight(found), 0, 3]))


def test_compete_with_radius_zero_scores_the_pose_alone(pillars):
    config = SgorConfig(hypothesis_radius=0.0)
    T = moved(0.3)
    for found in (compete(pillars, pillars, T, moved(8)[None], config),
                  alone(pillars, pillars, T)):
        assert found.T_target_source is T
        np.testing.assert_array_equal(found.outcomes,
                                      score_keypoints(pillars, pillars, T[None], 1000)[0])
        assert found.competing.shape == (0, 4, 4)
        assert found.competing_outcomes.shape == (0, 2000)
        assert found.degenerate == ()
        assert found.weak is False


def test_a_pose_that_scores_too_low_gets_more_rounds():
    """And is scored anew; what competes stays. One that scores enough is left as it is."""
    source, target = scattered(4), scattered(5)
    plain = hypothesis_test(source, target, np.eye(4), NOTHING, 30.0)
    confidence = pose_score(plain.outcomes).confidence
    assert 0.9 < confidence < 1
    enough = compete(source, target, np.eye(4), NOTHING, SgorConfig(min_confidence=confidence))
    np.testing.assert_array_equal(enough.T_target_source, plain.T_target_source)
    more = compete(source, target, np.eye(4), NOTHING, SgorConfig(min_confidence=1.0))
    T = icp(source, target, plain.T_target_source[None], 10, 10)
    assert not np.array_equal(T[0], plain.T_target_source)
    np.testing.assert_array_equal(more.T_target_source, T[0])
    assert not np.array_equal(more.outcomes, plain.outcomes)
    np.testing.assert_array_equal(more.outcomes, score_keypoints(source, target, T, 1000)[0])
    np.testing.assert_array_equal(more.competing, plain.competing)
    np.testing.assert_array_equal(more.competing_outcomes, plain.competing_outcomes)


def test_compete_looks_within_the_hypothesis_radius():
    index = index_of(*gallery(pitch=5.0))
    for radius, shifts in ((7.0, [-5, 5]), (13.0, [-10, -5, 5, 10])):
        found = compete(index, index, np.eye(4), NOTHING, SgorConfig(hypothesis_radius=radius))
        np.testing.assert_allclose(along(found), shifts, atol=0.01)


def rows_of(*counts, n=100):
    """Return outcomes with so many agreeing and violating keypoints each."""
    rows = np.zeros((len(counts), n), np.int8)
    for row, (agrees, violates) in zip(rows, counts, strict=True):
        row[:agrees] = 1
        row[n - violates:] = -1
    return rows


def test_distinct_poses_come_best_first_and_once(bare):
    """By exclusive violations, then by support; of those that lie together the best."""
    poses = np.array([moved(), moved(10), moved(20), moved(10.3), moved(30), moved(0.3),
                      moved(40)])
    outcomes = rows_of((100, 0), (80, 0), (90, 0), (85, 0), (70, 0), (99, 0), (97, 3))
    standing = np.array([False, True, True, True, True, True, False])
    kept = _distinct(poses, outcomes, 0, standing, (), bare)
    assert kept == [2, 3, 4]
    standing[6] = True    # 3 violations are worse than any lack of support
    assert _distinct(poses, outcomes, 0, standing, (), bare) == [2, 3, 4, 6]
    # where the answer itself violates what they explain they come first
    outcomes[0, :50] = -1
    outcomes[4, :] = 1
    outcomes[6] = outcomes[0]
    assert _distinct(poses, outcomes, 0, standing, (), bare)[0] == 4


def test_distinct_poses_of_the_same_rank_stay_in_their_order(bare):
    poses = np.array([moved(), moved(30), moved(10), moved(20)])
    outcomes = rows_of((100, 0), (90, 0), (90, 0), (90, 0))
    standing = np.array([False, True, True, True])
    assert _distinct(poses, outcomes, 0, standing, (), bare) == [1, 2, 3]
    assert _distinct(poses, outcomes, 0, np.zeros(4, np.bool_), (), bare) == []


def test_what_is_the_answer_but_for_a_slide_is_no_other_pose(bare):
    """Nor are two poses that differ by the slide only two."""
    slide = DegenerateDirection(ALONG_X, 10.0, 20.0)
    poses = np.array([moved(3), moved(12), moved(0, 2), moved(9, 2), moved(0, 0, 0, 180),
                      moved(7, 0, 0, 180)])
    outcomes = rows_of(*[(100 - k, 0) for k in range(6)])
    standing = np.ones(6, np.bool_)
    assert _distinct(poses, outcomes, 0, standing, (slide,), bare) == [2, 4]
    assert _distinct(poses, outcomes, 0, standing, (), bare) == [1, 2, 3, 4, 5]
