"""How far off an alignment may be, by hand: noise, parts that disagree, errors that repeat."""
from galleries import moved
import numpy as np
import pytest

from sgor_ros.core.icp.covariance import between_parts
from sgor_ros.core.icp.covariance import correlated_error
from sgor_ros.core.icp.covariance import correlated_part
from sgor_ros.core.icp.covariance import noise

INFORMATION = np.diag([100.0, 200.0, 400.0, 1e4, 2e4, 4e4])


def test_noise_is_the_inverse_information_by_the_mean_square():
    """102 pairs, 306 residuals less six: 2 * 15 / 300 = 0.1, and eight pairs err as one."""
    found = noise(INFORMATION, 15.0, 102)
    np.testing.assert_allclose(found, np.diag(0.1 * 8 / np.diag(INFORMATION)), rtol=1e-12)


def test_noise_of_a_full_matrix_is_symmetric():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6))
    information = A @ A.T + np.eye(6)
    found = noise(information, 15.0, 102)
    np.testing.assert_allclose(found @ information, 0.8 * np.eye(6), atol=1e-12)
    np.testing.assert_array_equal(found, found.T)


def test_a_scan_that_fits_without_noise_has_some():
    """Sent twice: the least mean square is 0.01."""
    for error in (0.0, 1.0, 1.49):
        np.testing.assert_allclose(noise(INFORMATION, error, 102),
                                   np.diag(0.01 * 8 / np.diag(INFORMATION)))
    assert noise(INFORMATION, 1.6, 102)[0, 0] > 0.0101 * 8 / 100


@pytest.mark.parametrize(('pairs', 'known'), [(0, False), (6, False), (7, True)])
def test_six_pairs_hold_nothing_with_noise(pairs, known):
    assert (noise(INFORMATION, 1.0, pairs) is not None) is known


@pytest.mark.parametrize(('least', 'known'), [(0.0, False), (1e-9, False), (1e-7, True)])
def test_a_direction_that_nothing_observes_has_no_covariance(least, known):
    """The condition of the information: 4e4 over the least is beyond 1e12."""
    information = np.diag([least, *np.diag(INFORMATION)[1:]])
    assert (noise(information, 1.0, 102) is not None) is known


def test_noise_at_the_limit_of_the_condition_is_known():
    information = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1e12])
    assert noise(information, 1.0, 102) is not None
    assert noise(information * np.diag([1, 1, 1, 1, 1, 1.1]), 1.0, 102) is None


def test_parts_that_pull_both_ways_tell_how_far_off_it_is():
    """Two parts pull by 3 along x, one each way: 2 * 9 over the information squared, twice."""
    gradients = np.zeros((64, 6))
    gradients[3, 0], gradients[40, 0] = 3.0, -3.0
    expected = np.zeros((6, 6))
    expected[0, 0] = 2.0 * 18.0 / 100.0**2
    np.testing.assert_allclose(between_parts(INFORMATION, gradients), expected, atol=1e-15)


def test_the_spread_between_parts_is_that_of_repeated_fits():
    """Lines of 20 observations in groups of ten that err alike: the usual formula is far off."""
    rng = np.random.default_rng(0)
    design = rng.normal(size=(40, 10, 6))
    information = np.einsum('gij,gik->jk', design, design)
    fits, claimed = [], []
    for _ in range(400):
        error = rng.normal(size=(40, 1)) + 0.1 * rng.normal(size=(40, 10))
        fit = np.linalg.solve(information, np.einsum('gij,gi->j', design, error))
        left = error - design @ fit
        claimed.append(between_parts(information, -np.einsum('gij,gi->gj', design, left)))
        fits.append(fit)
    # by CORRELATED_PARTS = 2 on purpose
    np.testing.assert_allclose(np.diag(np.mean(claimed, axis=0)) / 2, np.var(fits, axis=0),
                               rtol=0.25)


def test_a_quarter_of_what_the_parts_tell_errs_alike():
    root = np.diag([0.01, 0.002, 0.002, 1e-4, 1e-4, 1e-4])
    both = correlated_part(root, np.diag([4e-4, 0, 8e-4, 0, 4e-8, 0]))
    np.testing.assert_allclose(both, np.diag(np.sqrt([1e-4 + 1e-4, 4e-6, 4e-6 + 2e-4, 1e-8,
                                                      1e-8 + 1e-8, 1e-8])), atol=1e-12)
    np.testing.assert_allclose(correlated_part(root, np.zeros((6, 6))), root, atol=1e-12)


def test_what_errs_alike_is_a_symmetric_root_and_nothing_negative():
    """Where rounding makes an eigenvalue negative there is nothing to take a root of."""
    rng = np.random.default_rng(0)
    A = 1e-2 * rng.normal(size=(6, 6))
    zero = np.zeros((6, 6))
    both = correlated_part(zero, A @ A.T)
    np.testing.assert_allclose(both @ both.T, 0.25 * A @ A.T, atol=1e-15)
    np.testing.assert_allclose(both, both.T, atol=1e-12)
    np.testing.assert_array_equal(correlated_part(zero, np.eye(6) * -1e-9), zero)


def test_nothing_repeats_at_rest():
    np.testing.assert_array_equal(correlated_error(np.eye(4), 20.0, 0.5), np.zeros((6, 6)))


@pytest.mark.parametrize(('metres', 'size'), [(0.1, 0.1), (0.4, 0.4), (0.5, 0.5), (30.0, 0.5)])
def test_a_motion_along_x_repeats_along_it_most(metres, size):
    """2 % of the way up to an edge of the grid; across 0.2 %; a turn by 1.8 % at 20 m."""
    np.testing.assert_allclose(
        correlated_error(moved(metres), 20.0, 0.5),
        size * np.diag([0.02, 0.002, 0.002] + [0.018 / 20] * 3), atol=1e-15)


def test_an_oblique_motion_repeats_along_itself():
    root = correlated_error(moved(0.18, 0.24), 20.0, 0.5)    # 0.3 m
    along = np.array([0.6, 0.8, 0.0])
    np.testing.assert_allclose(root[:3, :3] @ along, 0.3 * 0.02 * along, atol=1e-15)
    np.testing.assert_allclose(root[:3, :3] @ [-0.8, 0.6, 0], 0.3 * 0.002 * np.array(
        [-0.8, 0.6, 0]), atol=1e-15)
    np.testing.assert_allclose(root[3:, 3:], 0.3 * 0.018 / 20 * np.eye(3), atol=1e-15)
    np.testing.assert_array_equal(root[:3, 3:], 0.0)
    np.testing.assert_array_equal(root[3:, :3], 0.0)


def test_a_turn_counts_as_the_way_of_what_it_moves():
    """10 mrad at 20 m are 0.2 m; with 0.1 m of motion 0.3 m; without, no direction is along."""
    turn = np.degrees(0.01)
    np.testing.assert_allclose(correlated_error(moved(yaw_deg=turn), 20.0, 0.5),
                               0.2 * np.diag([0.002] * 3 + [0.018 / 20] * 3), rtol=1e-9)
    np.testing.assert_allclose(correlated_error(moved(0, 0.1, yaw_deg=-turn), 20.0, 0.5),
                               0.3 * np.diag([0.002, 0.02, 0.002] + [0.018 / 20] * 3), rtol=1e-9)
    np.testing.assert_allclose(correlated_error(moved(roll_deg=180), 20.0, 0.5),
                               0.5 * np.diag([0.002] * 3 + [0.018 / 20] * 3), rtol=1e-9)


@pytest.mark.parametrize(('T', 'size'), [(moved(), 0.0), (moved(roll_deg=180), 0.5)])
def test_rounding_of_a_rotation_makes_no_error_that_is_none(T, size):
    """A trace beyond 3, or below -1, by a few last digits has no arc cosine."""
    T[:3, :3] *= 1 + 1e-12
    np.testing.assert_allclose(correlated_error(T, 20.0, 0.5),
                               size * np.diag([0.002] * 3 + [0.018 / 20] * 3), atol=1e-12)


def test_the_edge_of_the_grid_and_the_middle_range_scale_it():
    root = correlated_error(moved(30.0), 10.0, 0.2)
    np.testing.assert_allclose(root, 0.2 * np.diag([0.02, 0.002, 0.002] + [0.0018] * 3),
                               atol=1e-15)
