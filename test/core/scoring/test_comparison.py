"""Poses compared: which differ, which free space rules out, which is best; counted by hand."""
from galleries import index_of
from galleries import moved
import numpy as np
import pytest

from sgor_ros.core.scoring.comparison import apart
from sgor_ros.core.scoring.comparison import best_supported
from sgor_ros.core.scoring.comparison import differ
from sgor_ros.core.scoring.comparison import exclusive_violations
from sgor_ros.core.scoring.comparison import ruled_out

ONE = (np.array([[5.0, 0, 0]]), np.array([[-1.0, 0, 0]]))


@pytest.fixture(scope='module')
def level():
    """Return a target on level ground with a maximum correspondence distance of half a metre."""
    return index_of(*ONE, max_distance=0.5)


@pytest.fixture(scope='module')
def tumbling():
    return index_of(*ONE, up=None, max_distance=0.5)


def outcomes(*runs, n):
    """Return outcomes (n,) of runs of (count, value), and nothing observed after them."""
    row = np.concatenate([np.full(count, value, np.int8) for count, value in runs])
    return np.concatenate((row, np.zeros(n - len(row), np.int8)))


def pair(against, back, agree=100, n=1000):
    """Return an answer and another pose with so many exclusive violations, alike elsewhere."""
    answer = outcomes((against, 1), (back, -1), (agree, 1), n=n)
    other = outcomes((against, -1), (back, 1), (agree, 1), n=n)
    return answer, other


def test_violations_count_where_the_other_agrees():
    """Both violating, both agreeing, or one not observed: that tells the poses not apart."""
    answer = np.array([1, 1, 1, -1, -1, -1, 0, 0, 0], np.int8)
    others = np.array([[1, -1, 0, 1, -1, 0, 1, -1, 0], [-1, -1, -1, 1, 1, -1, 0, 0, 0]], np.int8)
    against, back = exclusive_violations(answer, others)
    assert against.tolist() == [1, 3]
    assert back.tolist() == [1, 2]


@pytest.mark.parametrize(('against', 'back', 'n', 'out'), [
    (0, 0, 1000, False), (4, 0, 1000, False), (5, 0, 1000, True),   # by a count of five,
    # less those of the answer and half as many for noise: 5 + 1.5, 5 + 4.5; three times as many
    (6, 1, 1000, False), (7, 1, 1000, True), (9, 3, 1000, False), (10, 3, 1000, True),
    (11, 4, 1000, False), (12, 4, 1000, True),
    (11, 0, 4000, False), (12, 0, 4000, True),                      # of 4,000 by 0.3 %
    (0, 50, 1000, False)])
def test_free_space_rules_out_what_alone_violates(against, back, n, out):
    answer, other = pair(against, back, n=n)
    assert ruled_out(answer, other[None]).tolist() == [out]


@pytest.mark.parametrize(('own', 'others', 'out'), [
    (0, 12, False), (0, 13, True), (10, 42, False), (10, 43, True), (100, 312, False),
    (100, 313, True)])
def test_far_too_many_violations_rule_out_wherever_they_are(own, others, out):
    """Where the answer observes nothing: 1.25 % of 1,000 beyond three times those of its own."""
    answer = outcomes((own, -1), (100, 1), n=1000)
    other = outcomes((own, -1), (100, 1), (others - own, -1), n=1000)
    assert exclusive_violations(answer, other[None])[0].tolist() == [0]
    assert ruled_out(answer, other[None]).tolist() == [out]


@pytest.mark.parametrize(('agree', 'out'), [(0, True), (89, True), (90, False), (200, False)])
def test_what_explains_too_little_is_ruled_out(agree, out):
    """Of 200 that agree with the answer another pose has to explain 90."""
    answer = outcomes((200, 1), n=1000)
    assert ruled_out(answer, outcomes((agree, 1), n=1000)[None]).tolist() == [out]


def test_each_other_pose_is_judged_by_itself():
    answer, guilty = pair(20, 0)
    found = ruled_out(answer, np.array([answer, guilty, 0 * answer, pair(4, 0)[1]]))
    assert found.tolist() == [False, True, True, False]


@pytest.mark.parametrize(('T', 'on_level', 'without_ground'), [
    (moved(0.5), False, False), (moved(0.51), True, True), (moved(0, -0.51), True, True),
    (moved(0.4, 0.4), True, True), (moved(0, 0, 2), False, True),
    (moved(0, yaw_deg=4.9), False, False), (moved(0, yaw_deg=-5.1), True, True),
    (moved(0, roll_deg=6), False, True)])
def test_poses_differ_beyond_half_a_metre_or_five_degrees(level, tumbling, T, on_level,
                                                          without_ground):
    """On level ground only in its plane: height, roll and pitch are not for keypoints to say."""
    base = moved(3, -2, 1, 40)
    other = T @ base
    other[:3, 3] = base[:3, 3] + T[:3, 3]
    assert differ(base, other[None], level).tolist() == [on_level]
    assert differ(base, other[None], tumbling).tolist() == [without_ground]


def test_poses_differ_by_some_maximum_distances(level):
    others = np.array([moved(1.0), moved(1.01), moved(yaw_deg=6)])
    assert differ(np.eye(4), others, level, 2.0).tolist() == [False, True, True]
    assert differ(np.eye(4), others[:0], level).tolist() == []


def test_nobody_beats_the_first_without_a_clear_lead():
    answer, other = pair(0, 4)
    assert best_supported(np.array([answer, other])) == 0
    assert best_supported(answer[None]) == 0
    assert best_supported(np.array([answer, answer, answer])) == 0


@pytest.mark.parametrize(('against', 'back', 'n', 'best'), [
    (0, 5, 1000, 1), (1, 4, 1000, 0), (1, 6, 1000, 1), (3, 8, 1000, 0), (3, 9, 1000, 1),
    (0, 11, 4000, 0), (0, 12, 4000, 1)])
def test_a_pose_that_the_answer_violates_alone_wins(against, back, n, best):
    answer, other = pair(against, back, n=n)
    assert best_supported(np.array([answer, other])) == best


@pytest.mark.parametrize(('agree', 'violates', 'best'), [
    (44, 0, 1), (45, 0, 0), (0, 0, 1), (44, 12, 1), (44, 13, 0)])
def test_a_pose_with_so_much_more_support_wins(agree, violates, best):
    """100 agree, of which 45 % have to; not where too many violations rule it out."""
    answer = outcomes((agree, 1), n=1000)
    other = outcomes((100, 1), (violates, -1), n=1000)
    assert best_supported(np.array([answer, other])) == best


@pytest.mark.parametrize(('agree', 'best'), [(30, 0), (89, 0), (90, 1), (150, 1)])
def test_a_pose_that_is_hardly_anywhere_does_not_win(agree, best):
    """The first agrees with 200; what has no more violations than keypoints to violate loses."""
    answer = outcomes((200, 1), (30, -1), n=1000)
    other = outcomes((agree - 30, 1), (230 - agree, 0), (30, 1), n=1000)
    other[200:230] = 1
    other[agree - 30:200] = 0
    assert (other == 1).sum() == agree
    assert best_supported(np.array([answer, other])) == best


def test_the_clearest_of_several_wins_and_may_be_beaten_in_turn():
    answer = outcomes((100, 1), (30, -1), n=1000)
    some, more = answer.copy(), answer.copy()
    some[100:110] = 1
    more[100:120] = 1
    assert best_supported(np.array([answer, some, more])) == 2
    assert best_supported(np.array([answer, more, some])) == 1
    # a third that the answer beats nowhere clearly, and the winner violates alone
    third = answer.copy()
    third[100:104], third[104:110], third[200:206], some[200:206] = 1, 0, 1, -1
    assert best_supported(np.array([answer, third])) == 0
    assert best_supported(np.array([answer, some])) == 1
    assert best_supported(np.array([answer, some, third])) == 2


def test_of_candidates_the_first_that_differ_are_kept(level):
    poses = np.array([moved(0.2), moved(10), moved(10.3), moved(20), moved(0, 20), moved(9.8),
                      moved(30)])
    for most, rows in ((9, [1, 3, 4, 6]), (3, [1, 3, 4]), (1, [1]), (0, [])):
        np.testing.assert_array_equal(apart(poses, np.eye(4), level, most), poses[rows])
    assert apart(poses[:1], np.eye(4), level, 3).shape == (0, 4, 4)
    assert apart(poses[:0], np.eye(4), level, 3).shape == (0, 4, 4)
