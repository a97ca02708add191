"""Two-stage verification: ground normals, then truncated distance (Sec. III-D)."""
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import register_correspondences
from sgor_ros import SgorConfig
from sgor_ros.core.matching.correspondences import Correspondences
from sgor_ros.core.solver.hypotheses import Hypotheses
from sgor_ros.core.solver.verification import ground_angles
from sgor_ros.core.solver.verification import truncated_distance
from sgor_ros.core.solver.verification import verify
from sgor_ros.evaluation import dense_reference as dense

UP = np.array([0, 0, 1.0])


def pose(roll_deg=0.0, yaw_deg=0.0, x=0.0):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('zx', [yaw_deg, roll_deg], degrees=True).as_matrix()
    T[0, 3] = x
    return T


def matches_of(source, target):
    none = np.zeros(len(source), np.uint8)
    return Correspondences(source, target, none, none, none, none)


def judged(transforms, normals=(UP, UP), **settings):
    """Return the verdict on transforms for 20 matches that do not move."""
    points = np.random.default_rng(0).uniform(-20, 20, (20, 3))
    hypotheses = Hypotheses(np.array(transforms).reshape(-1, 4, 4),
                            np.arange(20))
    return verify(hypotheses, matches_of(points, points), normals, None, SgorConfig(**settings))


@pytest.mark.parametrize(('roll', 'expected'), [(0, 0), (3, 3), (90, 90), (177, 177), (180, 180)])
def test_angle_between_the_grounds_by_hand(roll, expected):
    """Roll tilts the ground, yaw does not; upside down is 180 degrees and not 0."""
    for yaw in (0, 77, -160):
        angle = ground_angles(pose(roll, yaw)[None], UP, UP)[0]
        assert math.degrees(angle) == pytest.approx(expected, abs=1e-6)


def test_angle_of_tilted_sensors():
    """Each normal is in its own sensor's frame."""
    tilted = Rotation.from_euler('y', 30, degrees=True).as_matrix()
    T = np.eye(4)
    T[:3, :3] = tilted
    assert ground_angles(T[None], UP, tilted @ UP)[0] == pytest.approx(0, abs=1e-9)
    assert math.degrees(ground_angles(T[None], UP, UP)[0]) == pytest.approx(30)


def test_threshold_of_the_ground_check():
    """Just under sigma_theta passes, just over does not, upside down never."""
    verdict = judged([pose(4.99), pose(5.01), pose(180), pose(0, 120)])
    assert verdict.passed_ground_check.tolist() == [True, False, False, True]
    assert np.isinf(verdict.cost).tolist() == [False, True, True, False]
    assert judged([pose(5.01)], sigma_theta=0.1).passed_ground_check.all()


def test_the_nearest_fit_wins_among_those_that_pass():
    """The identity fits best but for those that it is not among."""
    assert judged([pose(x=0.9), pose(), pose(x=0.5)]).best == 1
    tilted = pose(20)
    assert judged([pose(x=0.9), tilted, pose(x=0.5)]).best == 2
    verdict = judged([tilted, pose(x=9)], ground_check=False)
    assert verdict.passed_ground_check.all()
    assert np.isfinite(verdict.cost).all()


def test_without_normals_there_is_no_ground_check():
    verdict = judged([pose(170), pose(180)], normals=None)
    assert verdict.passed_ground_check.all()
    assert verdict.best in (0, 1)


def test_all_refused_and_none_at_all_have_different_reasons():
    verdict = judged([pose(20), pose(90), pose(180)])
    assert verdict.best == -1
    assert verdict.reason == 'none of 3 hypotheses keeps the ground level'
    verdict = judged([])
    assert verdict.best == -1
    assert verdict.reason == 'no group of correspondences is consistent'


SIGMA = 0.4


@pytest.mark.parametrize(('distance', 'expected'), [
    (0.0, 0.2), (0.1, 0.2), (0.2, 0.2), (0.2001, 0.2001), (0.5, 0.5), (0.9999, 0.9999), (1.0, 1.0),
    (1.0001, 1.0), (50.0, 1.0)])
def test_truncated_distance_by_hand(distance, expected):
    """Eq. 19 with sigma_d 0.4 m: flat below 0.2 m and above 1 m, and at both borders."""
    found = truncated_distance(np.eye(4)[None], np.zeros((1, 3)), np.array([[0, distance, 0]]),
                               SIGMA)
    assert found[0] == pytest.approx(expected, abs=1e-9)


def test_truncated_distance_equals_the_dense_reference():
    rng = np.random.default_rng(1)
    source = rng.uniform(-10, 10, (200, 3))
    target = source + rng.normal(0, 0.5, (200, 3))
    transforms = np.array([pose(r, y, x) for r, y, x in rng.normal(0, 1, (15, 3))])
    found = truncated_distance(transforms, source, target, SIGMA)
    expected = [dense.truncated_distance(T, source, target, SIGMA) for T in transforms]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert np.ptp(found) > 0.05


def test_only_the_filtered_matches_count():
    """The sum runs over G' and nothing else."""
    points = np.random.default_rng(2).uniform(-20, 20, (6, 3))
    target = points.copy()
    target[:2] += [3, 0, 0]
    T = np.array([pose(), pose(x=3)])
    union = np.arange(4)
    verdict = verify(Hypotheses(T, union), matches_of(points, target), None, None, SgorConfig())
    np.testing.assert_allclose(verdict.cost, [
        dense.truncated_distance(t, points[union], target[union], SgorConfig().sigma_d)
        for t in T])


def test_ground_check_of_given_matches():
    """Right matches with normals that contradict: refused, with the reason, unless it is off."""
    source = np.random.default_rng(3).uniform(-20, 20, (100, 3))
    T = pose(0, 40, 5)
    target = source @ T[:3, :3].T + T[:3, 3]
    good = register_correspondences(source, target, ground_normals=(UP, UP))
    np.testing.assert_allclose(good.T_target_source, T, atol=1e-6)
    assert good.success
    assert good.solution.passed_ground_check.all()
    bad = register_correspondences(source, target, ground_normals=(UP, -UP))
    assert not bad.success
    assert bad.T_target_source is None
    assert 'keeps the ground level' in bad.reason
    assert len(bad.solution.hypotheses) == len(bad.solution.passed_ground_check) > 0
    assert not bad.solution.passed_ground_check.any()
    off = register_correspondences(source, target, ground_normals=(UP, -UP),
                                   config=SgorConfig(ground_check=False))
    assert off.success
