"""Degenerate directions by hand: poses pushed and slid back, covariances, words."""
from galleries import moved
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros.core.degeneracy.directions import DegenerateDirection
from sgor_ros.core.degeneracy.directions import in_words
from sgor_ros.core.degeneracy.directions import independent
from sgor_ros.core.degeneracy.directions import inflated
from sgor_ros.core.degeneracy.directions import is_shift
from sgor_ros.core.degeneracy.directions import perturbed_poses
from sgor_ros.core.degeneracy.directions import slid_back

ALONG_X = np.array([1.0, 0, 0, 0, 0, 0])
ABOUT_Z = np.array([0, 0, 0, 0, 0, 0.05])    # by a metre at 20 m


def direction(*twist, sigma=10.0, lever=20.0):
    return DegenerateDirection(np.array(twist, float), sigma, lever)


@pytest.mark.parametrize(('twist', 'shift'), [
    (ALONG_X, True), ((0, 0.8, 0, 0, 0, 0.03), True), (ABOUT_Z, False),
    ((0.7, 0, 0, 0, 0, 0.05), False), ((0.5, 0.6, 0, 0, 0, 0.05), True),
    ((0.6, 0, 0, 0.5, 0, 0), False)])
def test_a_twist_is_a_shift_where_the_larger_part_of_its_metre_is(twist, shift):
    assert is_shift(np.array(twist, float)) is shift


def test_poses_are_pushed_about_their_own_origin():
    """The translation is added in the target frame, the rotation turns the pose where it is."""
    T = moved(3, 1, 0, 30)
    found = perturbed_poses(T, np.array([[1.0, 2, 3, 0, 0, 0], [0, 0, 0, 0, 0, 0.5],
                                         [1, 0, 0, 0.2, 0, 0]]))
    np.testing.assert_allclose(found[0, :3, 3], [4, 3, 3])
    np.testing.assert_allclose(found[0, :3, :3], T[:3, :3], atol=1e-12)
    np.testing.assert_allclose(found[1], moved(3, 1, 0, 30 + np.degrees(0.5)), atol=1e-12)
    np.testing.assert_allclose(found[2, :3, 3], [4, 1, 0])
    np.testing.assert_allclose(
        found[2, :3, :3], Rotation.from_rotvec([0.2, 0, 0]).as_matrix() @ T[:3, :3], atol=1e-12)
    np.testing.assert_array_equal(found[:, 3], np.tile([0, 0, 0, 1], (3, 1)))
    np.testing.assert_array_equal(T, moved(3, 1, 0, 30))
    assert perturbed_poses(T, np.empty((0, 6))).shape == (0, 4, 4)


def test_poses_slide_back_along_a_shift_and_not_aside():
    slide = direction(0.8, 0.6, 0, 0, 0, 0)
    T = moved(3, 1, 0, 30)
    far = perturbed_poses(T, np.array([[5.6, 4.2, 0, 0, 0, 0]]))[0]
    np.testing.assert_allclose(slid_back(T, far, (slide,)), T, atol=1e-12)
    back = perturbed_poses(T, np.array([[-5.6, -4.2, 0, 0, 0, 0]]))[0]
    np.testing.assert_allclose(slid_back(T, back, (slide,)), T, atol=1e-12)
    aside = perturbed_poses(T, np.array([[-1.2, 1.6, 0, 0, 0, 0]]))[0]
    np.testing.assert_allclose(slid_back(T, aside, (slide,)), aside, atol=1e-12)
    np.testing.assert_array_equal(slid_back(T, far, ()), far)


def test_a_pose_slides_back_as_far_as_its_directions_let_it():
    """Far and aside: what is left is aside, and the by-product of a twist does not mislead."""
    T = moved(3, 1)
    slide = direction(1.0, 0, 0, 0, 0, 0.004)
    other = perturbed_poses(T, np.array([[7.0, 2.0, 0.5, 0, 0, 0.028]]))[0]
    np.testing.assert_allclose(slid_back(T, other, (slide,)), moved(3, 3, 0.5), atol=1e-9)
    rolled = slid_back(moved(), moved(2, roll_deg=50), (direction(1.0, 0, 0, 0.1, 0, 0),))
    np.testing.assert_allclose(rolled, moved(roll_deg=50 - np.degrees(0.2)), atol=1e-9)
    # the shift alone says how far, whatever the turn is
    turned = perturbed_poses(T, np.array([[7.0, 0, 0, 0, 0, 0.5]]))[0]
    found = slid_back(T, turned, (slide,))
    np.testing.assert_allclose(found[:3, 3], [3, 1, 0], atol=1e-9)
    np.testing.assert_allclose(found, perturbed_poses(T, np.array([[0, 0, 0, 0, 0, 0.472]]))[0],
                               atol=1e-9)


def test_a_pose_turns_back_about_a_free_axis():
    T = moved(3, 1, 0, 10)
    shaft = direction(*ABOUT_Z)
    np.testing.assert_allclose(slid_back(T, moved(3, 1, 0, 100), (shaft,)), T, atol=1e-9)
    np.testing.assert_allclose(slid_back(T, moved(3, 2, 0, 100), (shaft,)), moved(3, 2, 0, 10),
                               atol=1e-9)
    roll = moved(roll_deg=50)
    np.testing.assert_allclose(slid_back(moved(), roll, (direction(0, 0, 0, 0.05, 0, 0),)),
                               moved(), atol=1e-9)
    # of a turn with a by-product it is the turn that says how far
    screw = direction(0.1, 0, 0, 0, 0, 0.05)
    found = slid_back(T, moved(3, 1, 0, 10 + np.degrees(0.5)), (screw,))
    np.testing.assert_allclose(found, moved(2, 1, 0, 10), atol=1e-9)


def test_two_directions_slide_back_in_turn():
    T = moved()
    found = slid_back(T, moved(5, -3, 1, 40), (direction(*ALONG_X), direction(0, 1, 0, 0, 0, 0),
                                               direction(*ABOUT_Z)))
    np.testing.assert_allclose(found, moved(0, 0, 1), atol=1e-9)


def test_covariance_grows_along_the_slide_and_by_a_hundredth_aside():
    """Sigma 10 m along x; aside 0.1 m, which at a lever of 20 m is 5 mrad."""
    before = np.diag([1e-4] * 3 + [1e-6] * 3)
    grown = inflated(before, (direction(*ALONG_X),))
    np.testing.assert_allclose(
        grown, before + np.diag([100 + 0.01, 0.01, 0.01] + [0.005**2] * 3), rtol=1e-12)
    np.testing.assert_array_equal(before, np.diag([1e-4] * 3 + [1e-6] * 3))
    np.testing.assert_array_equal(inflated(before, ()), before)


def test_covariance_of_two_slides_adds_up():
    diagonal = direction(0.6, 0.8, 0, 0, 0, 0, sigma=2.0)
    turn = direction(*ABOUT_Z, sigma=4.0, lever=10.0)
    grown = inflated(np.zeros((6, 6)), (diagonal, turn))
    expected = np.zeros((6, 6))
    expected[:2, :2] = 4 * np.outer([0.6, 0.8], [0.6, 0.8])
    expected[5, 5] = 16 * 0.05**2
    expected += np.diag([0.02**2 + 0.04**2] * 3 + [0.001**2 + 0.004**2] * 3)
    np.testing.assert_allclose(grown, expected, atol=1e-15)


def test_directions_are_unit_and_those_that_others_span_are_left_out():
    found = independent((direction(2, 0, 0, 0, 0, 0), direction(3, 4, 0, 0, 0, 0),
                         direction(0, 1, 0, 0, 0, 0), direction(*ABOUT_Z)))
    np.testing.assert_allclose(found, [ALONG_X, [0.6, 0.8, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]])
    short = independent((direction(*ALONG_X), direction(0.06, 0.08, 0, 0, 0, 0)))
    np.testing.assert_allclose(short, [ALONG_X, [0.6, 0.8, 0, 0, 0, 0]])
    assert independent(()).shape == (0, 6)
    np.testing.assert_allclose(independent((direction(*ALONG_X), direction(*-ALONG_X))),
                               [ALONG_X])


@pytest.mark.parametrize(('sine', 'count'), [(0.05, 1), (0.099, 1), (0.101, 2), (0.5, 2)])
def test_a_direction_counts_from_a_tenth_beyond_the_others(sine, count):
    nearly = (np.sqrt(1 - sine**2), sine, 0, 0, 0, 0)
    assert len(independent((direction(*ALONG_X), direction(*nearly)))) == count
    # the same in space, of three that nearly lie in a plane
    raised = (np.sqrt(1 - sine**2) * 0.6, np.sqrt(1 - sine**2) * 0.8, sine, 0, 0, 0)
    assert len(independent((direction(*ALONG_X), direction(0.6, 0.8, 0, 0, 0, 0),
                            direction(*raised)))) == 1 + count


@pytest.mark.parametrize(('lever', 'count'), [(1.0, 1), (100.0, 2)])
def test_rotations_weigh_as_lengths_at_the_lever(lever, count):
    """By 2 mrad a shift is another where the points are far away, and the same nearby."""
    found = independent((direction(*ALONG_X, lever=lever),
                         direction(1, 0, 0, 0, 0, 0.002, lever=lever)))
    assert len(found) == count


def test_words_name_each_way():
    assert in_words((direction(*ALONG_X),)) == (
        'degenerate: the clouds slide along (1.00, 0.00, 0.00)')
    assert in_words((direction(0, -2, 0, 0, 0, 0), direction(*ABOUT_Z))) == (
        'degenerate: the clouds slide along (0.00, -1.00, 0.00) and turn about '
        '(0.00, 0.00, 1.00)')
    assert 'turn about (0.60, 0.80, 0.00)' in in_words((direction(0.2, 0, 0, 0.03, 0.04, 0),))
