"""Weighted SVD of the groups and the refinement on all matches, against the dense reference."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SgorConfig
from sgor_ros.core.matching.correspondences import Correspondences
from sgor_ros.core.solver.consistency import FilteredGroups
from sgor_ros.core.solver.hypotheses import fit_transforms
from sgor_ros.core.solver.hypotheses import hypothesise
from sgor_ros.core.solver.refinement import distances
from sgor_ros.core.solver.refinement import refine
from sgor_ros.evaluation import dense_reference as dense


def random_pose(seed):
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = np.random.default_rng(seed).uniform(-50, 50, 3)
    return T


def moved(T, points):
    return points @ T[:3, :3].T + T[:3, 3]


def matches_of(source, target):
    none = np.zeros(len(source), np.uint8)
    return Correspondences(source, target, none, none, none, none)


def test_fits_equal_the_dense_reference():
    """All groups at once: each the weighted SVD of Eq. 14 and 15, whatever the noise."""
    rng = np.random.default_rng(0)
    source = rng.uniform(-20, 20, (25, 12, 3))
    target = np.array([moved(random_pose(i), p) for i, p in enumerate(source)])
    target += rng.normal(0, 1.0, target.shape)
    weights = rng.random((25, 12)) * rng.choice([1.0, 100.0], (25, 1))
    found = fit_transforms(source, target, weights)
    expected = [dense.weighted_svd(*group) for group in zip(source, target, weights, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_known_pose_is_recovered():
    source = np.random.default_rng(1).uniform(-20, 20, (1, 5, 3))
    T = random_pose(1)
    found = fit_transforms(source, moved(T, source[0])[None], np.ones((1, 5)))[0]
    np.testing.assert_allclose(found, T, atol=1e-9)


@pytest.mark.parametrize('flat', [False, True])
@pytest.mark.parametrize('mirror', [False, True])
def test_rotations_never_mirror(flat, mirror):
    """Planar and mirrored sets too: determinant one, orthogonal, finite."""
    rng = np.random.default_rng(2)
    source = rng.uniform(-20, 20, (40, 6, 3))
    target = np.array([moved(random_pose(i), p) for i, p in enumerate(source)])
    if flat:
        source[..., 2] = 1.5
        target[..., 2] = -3.0
    if mirror:
        target[..., 0] *= -1
    R = fit_transforms(source, target, np.ones((40, 6)))[:, :3, :3]
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-9)
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.tile(np.eye(3), (40, 1, 1)), atol=1e-9)


def test_planar_matches_give_the_pose():
    """Four points of one plane are enough."""
    source = np.array([[[0, 0, 2], [4, 0, 2], [0, 3, 2], [5, 5, 2.0]]])
    T = random_pose(3)
    found = fit_transforms(source, moved(T, source[0])[None], np.ones((1, 4)))[0]
    np.testing.assert_allclose(found, T, atol=1e-9)


def test_weight_zero_takes_no_part():
    rng = np.random.default_rng(4)
    source = rng.uniform(-20, 20, (1, 8, 3))
    T = random_pose(4)
    target = moved(T, source[0])[None].copy()
    target[0, 5:] += 30
    weights = np.array([[3.0, 1, 2, 5, 1, 0, 0, 0]])
    np.testing.assert_allclose(fit_transforms(source, target, weights)[0], T, atol=1e-9)


def test_each_group_follows_its_own_matches():
    """By hand: two groups share matches; those kept of each follow one pose."""
    rng = np.random.default_rng(5)
    source = rng.uniform(-20, 20, (9, 3))
    A, B = random_pose(6), random_pose(7)
    target = np.vstack((moved(A, source[:4]), moved(B, source[4:8]), source[8:]))
    filtered = FilteredGroups(np.array([[0, 1, 2], [6, 5, 4]]),
                              np.array([[9, 8, 7], [7, 6, 5]], np.float32))
    found = hypothesise(matches_of(source, target), filtered)
    np.testing.assert_allclose(found.T_target_source, [A, B], atol=1e-9)
    assert found.union.tolist() == [0, 1, 2, 4, 5, 6]


def test_the_union_is_of_all_groups():
    """Eq. 18: each match once; those of a group that is too small for a hypothesis too."""
    source = np.random.default_rng(9).uniform(-9, 9, (8, 3))
    filtered = FilteredGroups(np.array([[5, 1, 2, 0], [2, 7, -1, -1], [1, 5, 2, -1]]),
                              np.array([[4, 3, 2, 1], [2, 1, 0, 0], [3, 2, 1, 0]], np.float32))
    found = hypothesise(matches_of(source, source + 1), filtered)
    assert len(found.T_target_source) == 2
    assert found.union.tolist() == [0, 1, 2, 5, 7]


@pytest.mark.parametrize('positive', [0, 1, 2, 3, 4])
def test_groups_with_fewer_than_three_give_none(positive):
    """Only matches with weight count."""
    source = np.random.default_rng(8).uniform(-9, 9, (6, 3))
    kept, scores = np.full((1, 5), -1), np.zeros((1, 5), np.float32)
    kept[0, :positive], scores[0, :positive] = np.arange(positive), 1
    found = hypothesise(matches_of(source, source + 1), FilteredGroups(kept, scores))
    assert len(found.T_target_source) == (positive >= 3)
    assert found.union.tolist() == list(range(positive))
    if positive >= 3:
        assert np.isfinite(found.T_target_source).all()
        np.testing.assert_allclose(found.T_target_source[0, :3, 3], 1.0, atol=1e-9)


def test_distances_by_hand():
    T = np.eye(4)
    T[:3, 3] = 1, 0, 0
    T[:2, :2] = [[0, -1], [1, 0]]
    source, target = np.array([[1.0, 0, 0], [0, 0, 0]]), np.array([[1.0, 1, 0], [1, 3, 4]])
    np.testing.assert_allclose(distances(T, source, target), [0, 5], atol=1e-12)


def test_refinement_uses_all_that_are_near_and_nothing_else():
    """Eq. 20: the SVD of those within tau_1 of the hypothesis, wherever the others are."""
    rng = np.random.default_rng(10)
    source = rng.uniform(-30, 30, (300, 3))
    T = random_pose(11)
    target = moved(T, source) + rng.normal(0, 0.05, (300, 3))
    target[200:] += rng.uniform(2, 9, (100, 3))
    rough = T.copy()
    rough[:3, 3] += [0.1, -0.1, 0.05]
    config = SgorConfig(refinement_rounds=1)
    found = refine(rough, matches_of(source, target), config)
    near = np.linalg.norm(moved(rough, source) - target, axis=1) < config.tau_1
    assert 190 < near.sum() <= 200
    expected = dense.weighted_svd(source[near], target[near], np.ones(near.sum()))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.linalg.norm(found - T) < np.linalg.norm(rough - T) / 3


def test_each_round_starts_from_the_last():
    """Three rounds are one round three times; they reach more matches than one does."""
    rng = np.random.default_rng(12)
    source = rng.uniform(-60, 60, (300, 3))
    T = random_pose(13)
    matches = matches_of(source, moved(T, source) + rng.normal(0, 0.2, (300, 3)))
    rough = T.copy()
    rough[:3, :3] = rough[:3, :3] @ Rotation.from_rotvec([0, 0, 0.02]).as_matrix()
    once = SgorConfig(refinement_rounds=1)
    steps = [rough]
    for _ in range(3):
        steps.append(refine(steps[-1], matches, once))
    thrice = refine(rough, matches, once.replace(refinement_rounds=3))
    np.testing.assert_array_equal(thrice, steps[3])
    near = [(distances(t, matches.source, matches.target) < once.tau_1).sum() for t in steps]
    assert near[0] < near[1] < near[3]


def test_nothing_near_leaves_the_hypothesis():
    source = np.random.default_rng(14).uniform(-9, 9, (20, 3))
    T = random_pose(15)
    target = moved(T, source) + 5
    target[:2] = moved(T, source[:2])    # two are too few
    np.testing.assert_array_equal(refine(T, matches_of(source, target), SgorConfig()), T)
