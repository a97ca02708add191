"""What set_pose takes: a pose as any program writes it, and nothing that is none."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_node_health import given_pose

from sgor_ros.ros.services import start_of

T = np.eye(4)
T[:3, :3] = Rotation.from_rotvec([0.1, -0.2, 2.0]).as_matrix()
T[:3, 3] = 100.0, -50.0, 3.0
COVARIANCE = np.diag([0.04, 0.04, 0.01, 1e-4, 1e-4, 9e-4])


def scaled(factor):
    message = given_pose(T, COVARIANCE)
    q = message.pose.pose.orientation
    q.x, q.y, q.z, q.w = (factor * value for value in (q.x, q.y, q.z, q.w))
    return message


@pytest.mark.parametrize('factor', [1.0, -1.0, 0.6, 30.0, 1e200, 1e307])
def test_a_quaternion_of_any_length_is_its_rotation(factor):
    pose, covariance = start_of(scaled(factor), 'odom')
    np.testing.assert_allclose(pose, T, atol=1e-12)
    np.testing.assert_array_equal(covariance, COVARIANCE)


@pytest.mark.parametrize('factor', [0.0, 1e-3, 1e-200, np.nan, np.inf])
def test_what_is_no_rotation_is_refused(factor):
    assert start_of(scaled(factor), 'odom').startswith('its orientation is n')


def changed(i, j, value):
    covariance = COVARIANCE.copy()
    covariance[i, j] = value
    return covariance


@pytest.mark.parametrize(('covariance', 'says'), [
    (changed(0, 0, -1.0), 'not positive semidefinite: its least eigenvalue is -1'),
    (changed(0, 1, 0.01), 'not symmetric'),
    (changed(0, 1, 9.0) + changed(1, 0, 9.0), 'not positive semidefinite'),
    (changed(5, 5, np.nan), 'its covariance is not finite'),
    (changed(5, 5, 1e300), 'its covariance has an entry of 1e\\+300')])
def test_what_is_no_covariance_is_refused(covariance, says):
    with pytest.raises(AssertionError, match=says):
        raise AssertionError(start_of(given_pose(T, covariance), 'odom'))


def test_what_others_round_and_what_is_known_exactly_is_taken():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(6, 2))
    rounded = (half @ half.T).astype(np.float32).astype(np.float64)    # of rank 2
    rounded[0, 1] *= 1 + 1e-7
    _, covariance = start_of(given_pose(T, rounded), 'odom')
    np.testing.assert_array_equal(covariance, covariance.T)
    np.testing.assert_allclose(covariance, half @ half.T, rtol=1e-5, atol=1e-6)
    assert not start_of(given_pose(T, np.zeros((6, 6))), 'odom')[1].any()


def test_a_place_beyond_the_earth_is_refused():
    far = T.copy()
    far[0, 3] = 1e200
    assert 'its position is 1e+200 m away' in start_of(given_pose(far, COVARIANCE), 'odom')
