"""The perturbation test: pushed along a weak direction, what stays, and how far it goes on."""
from galleries import gallery
from galleries import index_of
from galleries import moved
import numpy as np
import pytest

from sgor_ros.core.degeneracy import perturbation_test as perturbation_module
from sgor_ros.core.degeneracy.perturbation_test import is_degenerate
from sgor_ros.core.degeneracy.perturbation_test import measured
from sgor_ros.core.degeneracy.perturbation_test import pushes_along
from sgor_ros.core.icp.point_to_plane import icp
from sgor_ros.core.scoring.pose_scoring import score_keypoints

ALONG_X = np.array([1.0, 0, 0, 0, 0, 0])
ABOUT_Z = np.array([0, 0, 0, 0, 0, 0.05])
BOTH = np.array([True, True])


@pytest.fixture(scope='module')
def bare():
    return index_of(*gallery(pitch=0.0))


def measure(index, twist, T=None, radius=30.0, lever=20.0):
    T = np.eye(4) if T is None else T
    outcomes = score_keypoints(index, index, T[None], 1000)[0]
    return measured(index, index, T, outcomes, twist, lever, radius, (3, 4), 1000)


def test_pushes_go_forth_and_back_by_two_maximum_distances(bare):
    np.testing.assert_allclose(pushes_along(np.array([ALONG_X, ABOUT_Z]), bare), [
        1.2 * ALONG_X, 1.2 * ABOUT_Z, -1.2 * ALONG_X, -1.2 * ABOUT_Z])
    assert pushes_along(np.empty((0, 6)), bare).shape == (0, 6)


@pytest.mark.parametrize(('forth', 'back', 'degenerate'), [
    (1.2, -1.2, True), (1.0, -0.93, True), (0.95, -0.96, False), (1.2, 0.0, False),
    (1.3, -0.7, True), (0.0, 0.0, False)])
def test_a_shift_is_degenerate_where_four_fifths_of_the_push_stay(forth, back, degenerate):
    """The mean of both ways, of 1.2 m: more than 0.96 m."""
    base = moved(5, 3, 1, 40)
    poses = np.array([base, base, base])
    poses[1, 0, 3] += forth
    poses[2, 0, 3] += back
    assert is_degenerate(poses, BOTH, 1.2 * ALONG_X) is degenerate


def test_four_fifths_themselves_are_not_enough():
    poses = np.array([moved(), moved(0.96), moved(-0.96)])
    assert 0.8 * 1.2 == 0.96
    assert is_degenerate(poses, BOTH, 1.2 * ALONG_X) is False


@pytest.mark.parametrize('length', [0.4, 3.0])
def test_a_push_of_any_length_is_measured_by_what_it_is(length):
    """A shift, though it is short; a turn by a long way."""
    shifted = np.array([moved(), moved(0.9 * length), moved(-0.9 * length)])
    assert is_degenerate(shifted, BOTH, length * ALONG_X) is True
    angle = np.degrees(0.9 * length * 0.05)
    turned = np.array([moved(), moved(roll_deg=angle), moved(roll_deg=-angle)])
    about_x = length * np.array([0, 0, 0, 0.05, 0, 0])
    assert is_degenerate(turned, BOTH, about_x) is True
    half = np.array([moved(), moved(roll_deg=angle / 2), moved(roll_deg=-angle / 2)])
    assert is_degenerate(half, BOTH, about_x) is False


def test_the_turn_of_a_shift_is_not_asked_for():
    """By half a metre and 0.4 rad: 0.45 m are enough."""
    poses = np.array([moved(), moved(0.45), moved(-0.45)])
    assert is_degenerate(poses, BOTH, np.array([0.5, 0, 0, 0.4, 0, 0])) is True


def test_pushes_that_came_to_the_same_place_are_each_compared_with_the_pose():
    poses = np.array([moved(), moved(yaw_deg=np.degrees(0.06)), moved(yaw_deg=np.degrees(0.055))])
    assert is_degenerate(poses, BOTH, 1.2 * ABOUT_Z) is True


@pytest.mark.parametrize(('forth', 'back', 'degenerate'), [
    (0.06, -0.06, True), (0.05, -0.047, True), (0.047, -0.048, False), (0.06, 0.0, False)])
def test_a_turn_is_degenerate_where_four_fifths_of_the_push_stay(forth, back, degenerate):
    """Of 60 mrad: more than 48; where the origin went to does not matter."""
    poses = np.array([moved(0, 0, 0, 30), moved(3, 0, 0, 30 + np.degrees(forth)),
                      moved(3, 0, 0, 30 + np.degrees(back))])
    assert is_degenerate(poses, BOTH, 1.2 * ABOUT_Z) is degenerate
    # nor does a turn matter to a shift
    assert is_degenerate(poses, BOTH, 1.2 * ALONG_X) is True


@pytest.mark.parametrize(('stands', 'degenerate'), [
    ((True, True), True), ((True, False), True), ((False, True), True), ((False, False), False)])
def test_one_of_the_pushed_has_to_stand(stands, degenerate):
    """At the end of a gallery one way leads into a wall."""
    poses = np.array([moved(), moved(1.2), moved(-1.2)])
    assert is_degenerate(poses, np.array(stands), 1.2 * ALONG_X) is degenerate


def test_bare_walls_go_on_without_end(bare):
    """As far as others are looked for: evenly over 30 m both ways."""
    found = measure(bare, ALONG_X)
    np.testing.assert_allclose(np.abs(found.twist), ALONG_X, atol=1e-3)
    assert found.sigma == pytest.approx(30 / np.sqrt(3))
    assert found.lever == 20.0


def test_where_it_was_laid_is_unknown_too(bare):
    """6 m along and across it nothing: 30 m / sqrt(3), and the way to where it lies now."""
    found = measure(bare, ALONG_X, moved(6.0), radius=15.0, lever=7.0)
    assert found.sigma == pytest.approx(np.hypot(15 / np.sqrt(3), 6.0), rel=1e-3)
    assert found.lever == 7.0


def test_a_crooked_eigenvector_is_straightened_by_the_places_it_stands_at(bare):
    """By 3 degrees off the axis: ICP brings what is pushed back between the walls."""
    crooked = np.array([np.cos(0.05), np.sin(0.05), 0, 0, 0, 0.001])
    found = measure(bare, crooked)
    np.testing.assert_allclose(np.abs(found.twist), ALONG_X, atol=5e-3)
    np.testing.assert_array_equal(found.twist[3:], 0.0)
    assert np.linalg.norm(found.twist) == pytest.approx(1.0)


@pytest.mark.parametrize(('level', 'low', 'high'), [(True, -1e-12, 1e-12), (False, 0.03, 0.06)])
def test_a_slide_does_not_leave_level_ground(level, low, high):
    """Pushed upwards by 0.04: without a ground plane nothing between two walls holds that."""
    bare = index_of(*gallery(pitch=0.0), up=np.array([0.0, 0, 1]) if level else None)
    found = measure(bare, np.array([np.cos(0.04), 0, np.sin(0.04), 0, 0, 0]))
    assert low < found.twist[2] / found.twist[0] < high
    assert np.linalg.norm(found.twist) == pytest.approx(1.0)
    assert found.sigma == pytest.approx(30 / np.sqrt(3), rel=1e-3)


def test_a_slide_that_ends_soon_is_no_longer_than_that():
    """Pushed by 2.4 m the pillars, 0.9 m deep, are beside themselves: four maximum distances."""
    pillars = index_of(*gallery(pitch=8.0))
    found = measure(pillars, ALONG_X)
    np.testing.assert_array_equal(found.twist, ALONG_X)
    assert found.sigma == pytest.approx(2.4)
    assert found.lever == 20.0


def test_a_place_where_it_stands_again_is_not_the_end_of_a_slide():
    """Pillars each 9.6 m: pushed by that it stands, by 2.4 m it does not."""
    pillars = index_of(*gallery(pitch=9.6))
    assert measure(pillars, ALONG_X).sigma == pytest.approx(2.4)


@pytest.mark.parametrize('way', [1, -1])
def test_a_slide_one_way_is_one(way):
    """Of 3 m that one sensor saw little is left 2.4 m on, where the other saw no further."""
    long = (-40.0, 3.0) if way < 0 else (0.0, 40.0)
    source, target = (index_of(*gallery(0.0, ends=ends)) for ends in ((0.0, 3.0), long))
    outcomes = score_keypoints(source, target, np.eye(4)[None], 1000)[0]
    found = measured(source, target, np.eye(4), outcomes, ALONG_X, 20.0, 30.0, (3, 4), 1000)
    assert found.sigma == pytest.approx(30 / np.sqrt(3), rel=1e-3)


def test_the_line_is_through_the_places_and_not_through_the_target():
    """From 3.8 m beside the middle."""
    points, normals = gallery(pitch=0.0)
    source, target = index_of(points - [0, 3.8, 0], normals), index_of(points, normals)
    T = moved(0, 3.8)
    outcomes = score_keypoints(source, target, T[None], 1000)[0]
    found = measured(source, target, T, outcomes, ALONG_X, 20.0, 30.0, (3, 4), 1000)
    np.testing.assert_allclose(np.abs(found.twist), ALONG_X, atol=1e-2)
    assert found.sigma == pytest.approx(30 / np.sqrt(3), rel=1e-2)


def test_a_turn_stays_the_turn_that_it_was():
    """In a round shaft: no line through its places, nor an offset along it."""
    angle, z = np.meshgrid(np.arange(0, 2 * np.pi, 0.05), np.arange(-3, 3.1, 0.5))
    out = np.stack((np.cos(angle), np.sin(angle), 0 * z), -1).reshape(-1, 3)
    shaft = index_of(8 * out + np.c_[0 * z.ravel(), 0 * z.ravel(), z.ravel()], -out)
    twist = np.array([0, 0, 0, 0, 0, 0.12])
    found = measure(shaft, twist, lever=8.2)
    np.testing.assert_array_equal(found.twist, twist)
    assert found.sigma == pytest.approx(30 / np.sqrt(3))


def test_longer_pushes_go_both_ways(bare, monkeypatch):
    """By 4 and by 16 maximum distances, forth and back of each."""
    pushed = []

    def fitted(source, target, T_target_source, *rounds):
        pushed.extend(T_target_source[:, 0, 3])
        return icp(source, target, T_target_source, *rounds)
    monkeypatch.setattr(perturbation_module, 'icp', fitted)
    measure(bare, ALONG_X)
    assert pushed == pytest.approx([2.4, -2.4, 9.6, -9.6])
