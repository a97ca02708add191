"""How doubt adds up along a track: against sampled noise, and against the truth of a street."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.core.common import se3
from sgor_ros.tracker.covariance import CORRELATION_LENGTHS_M
from sgor_ros.tracker.covariance import PoseCovariance
from sgor_ros.tracker.covariance import square_root
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

PERIOD_NS = 100_000_000
BOUND = 20.06
"""Squared distance in six dimensions that 99.7 % of honest errors stay below."""


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


def squared_distance(T, truth, covariance):
    error = se3.perturbation(T, truth)
    return error @ np.linalg.solve(covariance, error)


@pytest.mark.parametrize('speed', [1.5, 8.0])
@pytest.mark.parametrize('mode', ['consecutive', 'keyframe'])
def test_errors_are_as_large_as_is_claimed(mode, speed):
    """Through a street that nothing was fitted on: relative and absolute poses, and twist.

    Squared distances average near six where the covariance is right; they may be smaller, as
    what repeats is no larger everywhere than it can be, but none may be beyond the bound.
    """
    tracker = Tracker(tracker_config=TrackerConfig(mode=mode))
    truth, relative, absolute, twist = {}, [], [], []
    lidar = Lidar(beams=64, columns=900)
    for stamp, points, labels, T in simulate(25, seed=21, lidar=lidar, speed=speed):
        stamp_ns = round(stamp * 1e9)
        result = tracker.track(SemanticScan(points, labels), stamp_ns)
        truth[stamp_ns] = T
        assert result.success
        if stamp_ns == 0:
            continue
        np.linalg.cholesky(result.reference_covariance)
        np.linalg.cholesky(result.covariance)
        relative.append(squared_distance(
            result.T_reference_sensor,
            se3.inverse(truth[result.reference_stamp_ns]) @ T, result.reference_covariance))
        absolute.append(squared_distance(result.T_odom_sensor, se3.inverse(truth[0]) @ T,
                                         result.covariance))
        velocity = se3.log(se3.inverse(truth[stamp_ns - PERIOD_NS]) @ T) * 10
        off = result.twist - velocity
        twist.append(off @ np.linalg.solve(result.twist_covariance, off))
    for distances in (relative, absolute, twist):
        assert max(distances) < BOUND
        assert 0.2 < np.mean(distances) < 10
