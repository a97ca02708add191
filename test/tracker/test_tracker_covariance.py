"""How doubt adds up along a track: against sampled noise, and against the truth of a street."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.core.common import se3
from sgor_ros.core.icp.covariance import square_root
from sgor_ros.evaluation.metrics.consistency import track_consistency
from sgor_ros.evaluation.metrics.pose_error import nees
from sgor_ros.evaluation.metrics.pose_error import NEES_BOUND
from sgor_ros.tracker.covariance import CORRELATION_LENGTHS_M
from sgor_ros.tracker.covariance import PoseCovariance
from sgor_ros.world import Lidar
from sgor_ros.world import simulate


def step(x, y, z, *turn):
    return se3.compose(Rotation.from_rotvec(turn).as_matrix(), np.array([x, y, z]))


STEPS = [step(6.0, 1.0, 0.2, 0.0, 0.1, 1.2), step(4.0, -1.0, 0.0, 0.1, 0.0, -0.8),
         step(5.0, 0.0, -0.5, 0.0, 0.0, 0.3)]


def covariances(rng):
    """Return full covariances of steps, millimetres and milliradians."""
    for _ in STEPS:
        A = rng.normal(size=(6, 6)) * 1e-3
        yield A @ A.T + 1e-7 * np.eye(6)


def perturbed(T, noise):
    """Return (N, 4, 4) poses perturbed from the left, translation of the origin apart."""
    out = np.tile(np.eye(4), (len(noise), 1, 1))
    out[:, :3, :3] = Rotation.from_rotvec(noise[:, 3:]).as_matrix() @ T[:3, :3]
    out[:, :3, 3] = T[:3, 3] + noise[:, :3]
    return out


def spread(T, mean):
    """Return the (6, 6) covariance of poses around their mean."""
    turn = Rotation.from_matrix(T[:, :3, :3] @ mean[:3, :3].T).as_rotvec()
    return np.cov(np.hstack((T[:, :3, 3] - mean[:3, 3], turn)).T)


@pytest.mark.parametrize('share', [0.0, 0.6])
def test_covariance_is_that_of_composed_noise(share):
    """Steps with turns; a share of their variance errs alike: Monte Carlo finds the same.

    Compared where the sum is a unit matrix, so that a wrong lever or frame shows.
    """
    rng, count = np.random.default_rng(0), 60000
    T, samples = np.eye(4), np.tile(np.eye(4), (count, 1, 1))
    doubt, repeated = PoseCovariance.origin(), rng.normal(size=(count, 6))
    for move, covariance in zip(STEPS, covariances(rng), strict=True):
        root = np.sqrt(share) * square_root(covariance)
        alike = np.exp(-np.linalg.norm(move[:3, 3]) / CORRELATION_LENGTHS_M)
        repeated = alike * repeated + np.sqrt(1 - alike**2) * rng.normal(size=(count, 6))
        noise = (repeated @ root + np.sqrt(1 - share)
                 * rng.multivariate_normal(np.zeros(6), covariance, count))
        samples = samples @ perturbed(move, noise)
        doubt = doubt.then(T, move, covariance, root)
        T = T @ move
        whiten = np.linalg.inv(np.linalg.cholesky(doubt.pose))
        np.testing.assert_allclose(whiten @ spread(samples, T) @ whiten.T, np.eye(6), atol=0.04)


def test_what_errs_alike_adds_up():
    """Ten short steps with the same error along x: ten times, not the root of ten."""
    root = np.diag([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    alike, apart = PoseCovariance.origin(), PoseCovariance.origin()
    move = step(0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(10):
        alike = alike.then(np.eye(4), move, root @ root, root)
        apart = apart.then(np.eye(4), move, root @ root, None)
    assert np.sqrt(alike.pose[0, 0]) == pytest.approx(0.1, rel=0.01)
    assert np.sqrt(apart.pose[0, 0]) == pytest.approx(0.01 * np.sqrt(10))


@pytest.mark.slow
@pytest.mark.parametrize('speed', [1.5, 8.0])
@pytest.mark.parametrize('mode', ['consecutive', 'keyframe'])
def test_errors_are_as_large_as_is_claimed(mode, speed):
    """Through a street that nothing was fitted on: relative and absolute poses, and twist.

    Squared distances average near six where the covariance is right; they may be smaller, as
    what repeats is no larger everywhere than it can be, but none may be beyond the bound.
    """
    tracker = Tracker(tracker_config=TrackerConfig(mode=mode))
    tracked, truth, twist = [], [], []
    lidar = Lidar(beams=64, columns=900)
    for stamp, points, labels, T in simulate(25, seed=21, lidar=lidar, speed=speed):
        result = tracker.track(SemanticScan(points, labels), round(stamp * 1e9))
        assert result.success
        tracked.append(result)
        truth.append(T)
        if len(truth) > 1:
            np.linalg.cholesky(result.reference_covariance)
            np.linalg.cholesky(result.covariance)
            off = result.twist - se3.log(se3.inverse(truth[-2]) @ T) / 0.1
            twist.append(off @ np.linalg.solve(result.twist_covariance, off))
    said = track_consistency(tracked, np.array(truth))[1:]
    relative = [scan.step_nees for scan in said]
    absolute = [scan.pose_nees for scan in said]
    for distances in (relative, absolute, twist):
        assert max(distances) < NEES_BOUND
        assert 0.2 < np.mean(distances) < 10


def test_nees_of_right_covariances_is_six():
    """Errors drawn from the covariance that is claimed; twice the error is four times that."""
    rng = np.random.default_rng(1)
    covariance = next(covariances(rng))
    for factor, expected in ((1.0, 6.0), (2.0, 24.0)):
        noise = factor * rng.multivariate_normal(np.zeros(6), covariance, 2000)
        found = [nees(T, STEPS[0], covariance)
                 for T in perturbed(STEPS[0], noise)]
        assert np.mean(found) == pytest.approx(expected, rel=0.06)
        if factor == 1.0:
            assert np.mean(np.array(found) < NEES_BOUND) == pytest.approx(0.997, abs=0.003)


def test_a_step_by_hand():
    """Turned by 90 degrees the step's x is y; 2 m ahead a turn of the reference moves it."""
    pose = np.diag([1e-4, 2e-4, 3e-4, 1e-6, 2e-6, 3e-6])
    before = PoseCovariance(pose, np.zeros((6, 6)))
    T = step(5.0, 6.0, 7.0, 0.0, 0.0, np.pi / 2)
    found = before.then(T, step(2.0, 0, 0, 0, 0, 0), np.diag([4e-4, 5e-4, 6e-4, 4e-6, 5e-6, 6e-6]),
                        None)
    # the lever is (0, 2, 0): about x it moves z, about z it moves x the other way
    expected = np.diag([1e-4 + 4 * 3e-6 + 5e-4, 2e-4 + 4e-4, 3e-4 + 4 * 1e-6 + 6e-4,
                        1e-6 + 5e-6, 2e-6 + 4e-6, 3e-6 + 6e-6])
    expected[0, 5] = expected[5, 0] = -2 * 3e-6
    expected[2, 3] = expected[3, 2] = 2 * 1e-6
    np.testing.assert_allclose(found.pose, expected, atol=1e-15)
    np.testing.assert_array_equal(found.pose, found.pose.T)
    np.testing.assert_array_equal(found.shared, 0.0)


def test_what_is_shared_with_the_errors_to_come_by_hand():
    """It decays along the way, over 50 m in translation and 2 m in rotation."""
    rng = np.random.default_rng(0)
    shared, root = rng.normal(size=(2, 6, 6)) * 1e-2
    before = PoseCovariance(np.zeros((6, 6)), shared)
    T = step(0, 0, 0, 0, 0, np.pi / 2)
    found = before.then(T, step(0, -3.0, 4.0, 0, 0, 0), root @ root.T, root)    # 5 m
    turn = np.kron(np.eye(2), T[:3, :3])
    carry = np.eye(6)
    x, y, z = T[:3, :3] @ [0, -3.0, 4.0]
    carry[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    left = carry @ shared * np.exp([-0.1] * 3 + [-2.5] * 3)
    np.testing.assert_allclose(found.shared, left + turn @ root, atol=1e-15)
    both = left + turn @ root
    np.testing.assert_allclose(found.pose, both @ both.T - left @ left.T, atol=1e-15)


def test_a_track_begins_without_doubt():
    origin = PoseCovariance.origin()
    np.testing.assert_array_equal(origin.pose, np.zeros((6, 6)))
    np.testing.assert_array_equal(origin.shared, np.zeros((6, 6)))
