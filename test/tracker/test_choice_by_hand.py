"""Numbers behind the choice of a placement: gates, information, names; computed by hand."""
from dataclasses import replace

from galleries import moved
import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import Registration
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import TrackerConfig
from sgor_ros.core.execution.lazy import Lazy
from sgor_ros.core.icp.covariance import square_root
from sgor_ros.core.icp.gicp import align
from sgor_ros.core.verdict.result import Placement
from sgor_ros.core.verdict.result import Status
from sgor_ros.tracker.choice import _along
from sgor_ros.tracker.choice import _information
from sgor_ros.tracker.choice import choose
from sgor_ros.tracker.choice import is_likely
from sgor_ros.tracker.choice import refined
from sgor_ros.tracker.choice import Step
from sgor_ros.tracker.motion import Motion

PERIOD_NS = 100_000_000
CONFIG = TrackerConfig()
COVARIANCE = np.diag([0.01**2] * 3 + [0.001**2] * 3)
REPEATED = 0.1 * np.eye(6)
NO_DIRECTION = np.empty((0, 6))
ALONG_X = np.array([[1.0, 0, 0, 0, 0, 0]])
ABOUT_Z = np.array([[0.0, 0, 0, 0, 0, 1]])
GATE = 20.06


def registration(status, T, *others, covariance=COVARIANCE, degenerate=NO_DIRECTION):
    return Registration(status, 'said', T, np.zeros((20, 3)), np.zeros((20, 3)),
                        np.ones(20, np.bool_), 1.0, covariance, REPEATED, degenerate, others)


def placement(T, covariance=COVARIANCE, degenerate=NO_DIRECTION):
    return Placement(T, covariance, degenerate)


def as_it_is(placement):
    return placement


@pytest.fixture
def standing():
    """Return a motion that stands at the origin, known to 0.1 m and 10 mrad at the next stamp."""
    both = np.zeros((12, 12))
    both[:6, :6] = np.diag([0.1**2] * 3 + [0.01**2] * 3)
    return Motion(0, np.eye(4), np.zeros(6), both)


STILL = TrackerConfig(acceleration=0.001, turn_acceleration=0.001)
"""Nothing is added to what a motion knows by predicting it."""


@pytest.mark.parametrize(('status', 'T'), [
    (Status.NO_SOLUTION, None), (Status.REFUSED, moved(0.01))])
def test_nothing_is_made_of_what_was_refused(standing, status, T):
    """However near the candidate lies to the prediction."""
    assert choose(registration(status, T), standing, PERIOD_NS, CONFIG, as_it_is) == 'said'


def test_registered_is_taken_with_all_that_is_known_of_it(standing):
    T = moved(3.0)
    step = choose(registration(Status.REGISTERED, T), standing, PERIOD_NS, CONFIG, as_it_is)
    assert step.T_reference_sensor is T
    assert step.covariance is COVARIANCE
    assert step.correlated_error is REPEATED
    assert step.fused is None
    assert step.note == ''


def test_registered_has_to_be_possible(standing):
    """7 m in 0.1 s are 65 m/s, what is unknown of the pose before taken off; 6 m are 55."""
    doubt = 3 * np.sqrt(0.03)
    refused = choose(registration(Status.REGISTERED, moved(7.0)), standing, PERIOD_NS, CONFIG,
                     as_it_is)
    assert refused == f'{(7 - doubt) / 0.1:.1f} m/s is over max_speed 60.0'
    assert isinstance(choose(registration(Status.REGISTERED, moved(6.0)), standing, PERIOD_NS,
                             CONFIG, as_it_is), Step)


@pytest.mark.parametrize('sigmas', [4.4, 4.5])
@pytest.mark.parametrize('status', [Status.AMBIGUOUS, Status.DEGENERATE])
def test_the_gate_is_at_three_sigmas_in_six_dimensions(standing, status, sigmas):
    """Of both together, 0.1 m and 0.01 m: sqrt(20.06) = 4.479 of them."""
    T = moved(sigmas * np.hypot(0.1, 0.01))
    others = (placement(moved(100.0)),) if status is Status.AMBIGUOUS else ()
    step = choose(registration(status, T, *others), standing, PERIOD_NS, STILL, as_it_is)
    if sigmas == 4.4:
        assert step.T_reference_sensor is T
        assert step.covariance is COVARIANCE
        assert step.correlated_error is None
        assert step.fused is None
        assert step.note == 'ambiguous: the motion so far chose among the placements'
    else:
        count = '2 placements' if others else '1 placement'
        assert step == f'said; none of {count} would fit the motion so far'


def test_alternatives_are_refined_where_they_may_fit(standing):
    """Up to 4.479 of sigmas of 0.1 and 0.5 m: 2.28 m. Farther ones are not looked at."""
    asked = []

    def refine(other):
        asked.append(float(other.T_target_source[0, 3]))
        return placement(moved(0.1))
    limit = np.sqrt(GATE * (0.1**2 + 0.5**2 + 0.01**2))
    others = [placement(moved(x)) for x in (limit - 0.01, limit + 0.01, -limit + 0.01, 50.0)]
    step = choose(registration(Status.AMBIGUOUS, moved(9.0), *others), standing, PERIOD_NS,
                  STILL, refine)
    np.testing.assert_allclose(asked, [limit - 0.01, -limit + 0.01])
    assert step == 'said; 2 of 5 placements would fit the motion so far'
    # in turns by 30 mrad as well
    asked.clear()
    limit = np.degrees(np.sqrt(GATE * (0.01**2 + 0.03**2 + 0.001**2)))
    others = [placement(moved(yaw_deg=a)) for a in (limit * 0.99, limit * 1.01)]
    step = choose(registration(Status.AMBIGUOUS, moved(9.0), *others), standing, PERIOD_NS,
                  STILL, refine)
    assert len(asked) == 1
    np.testing.assert_array_equal(step.T_reference_sensor, moved(0.1))


def test_a_refined_alternative_has_to_fit_itself(standing):
    others = (placement(moved(0.1)), placement(moved(0.2)))
    found = registration(Status.AMBIGUOUS, moved(9.0), *others)
    step = choose(found, standing, PERIOD_NS, STILL, lambda other: placement(
        moved(5.0 if other is others[0] else 0.25)))
    np.testing.assert_array_equal(step.T_reference_sensor, moved(0.25))
    step = choose(found, standing, PERIOD_NS, STILL, lambda _: placement(moved(5.0)))
    assert step == 'said; none of 3 placements would fit the motion so far'


def test_what_fits_but_is_too_fast_does_not(standing):
    """A wide prediction lets 8 m fit; in 0.1 s no sensor of this sort goes there."""
    wide = replace(standing, covariance=np.diag([4.0] * 3 + [1e-4] * 3 + [0.0] * 6))
    found = registration(Status.DEGENERATE, moved(8.0))
    slow = TrackerConfig(max_speed=1.0)
    assert isinstance(choose(found, wide, PERIOD_NS, slow, as_it_is), Step), '3 sigmas are 10 m'
    narrow = replace(standing, covariance=np.diag([0.04] * 3 + [1e-4] * 3 + [0.0] * 6))
    found = registration(Status.DEGENERATE, moved(0.85))
    assert isinstance(choose(found, narrow, PERIOD_NS, slow, as_it_is), Step)
    exact = replace(standing, covariance=np.diag([1e-6] * 3 + [1e-4] * 3 + [0.0] * 6),
                    twist=np.array([8.0, 0, 0, 0, 0, 0]))
    found = registration(Status.DEGENERATE, moved(0.8))
    assert isinstance(choose(found, exact, PERIOD_NS, CONFIG, as_it_is), Step)
    assert choose(found, exact, PERIOD_NS, slow, as_it_is) == (
        'said; none of 1 placement would fit the motion so far')


def test_along_a_free_direction_the_prediction_counts(standing):
    """Across it both, by their variances: 0.1 m and 0.01 m say 0.2 m and 0: 100 parts of 101."""
    found = registration(Status.DEGENERATE, moved(5.0, 0.2), degenerate=ALONG_X)
    step = choose(found, standing, PERIOD_NS, STILL, as_it_is)
    np.testing.assert_allclose(step.T_reference_sensor, moved(0.0, 0.2 * 100 / 101), atol=1e-6)
    np.testing.assert_allclose(np.diag(step.covariance)[:3],
                               [0.01, 1 / (1e2 + 1e4), 1 / (1e2 + 1e4)], rtol=1e-3)
    np.testing.assert_array_equal(step.covariance, step.fused.pose_covariance)
    np.testing.assert_array_equal(step.T_reference_sensor, step.fused.T_reference_sensor)
    np.testing.assert_allclose(step.correlated_error @ step.correlated_error, step.covariance)
    assert step.note == 'degenerate: predicted along (1.00, 0.00, 0.00)'


@pytest.mark.parametrize(('variance', 'loose'), [(0.25, False), (0.2501, True)])
def test_a_placement_is_loose_beyond_half_a_metre(standing, variance, loose):
    """The root of the summed variances of where it is: then the prediction corrects it."""
    covariance = np.diag([variance - 0.0002, 1e-4, 1e-4] + [1e-6] * 3)
    found = registration(Status.AMBIGUOUS, moved(0.1), placement(moved(50.0), covariance),
                         covariance=covariance)
    step = choose(found, standing, PERIOD_NS, STILL, as_it_is)
    assert (step.fused is not None) is loose
    if loose:
        assert step.note == 'degenerate: predicted'
        assert 0 < step.T_reference_sensor[0, 3] < 0.01
    else:
        assert step.covariance is covariance


def test_a_large_covariance_of_turns_is_not_loose(standing):
    covariance = np.diag([1e-4] * 3 + [1.0] * 3)
    step = choose(registration(Status.DEGENERATE, moved(0.1), covariance=covariance), standing,
                  PERIOD_NS, STILL, as_it_is)
    assert step.fused is None


def test_the_best_placement_slides_as_the_first_of_its_rivals(standing):
    """An ambiguous registration has no directions of its own."""
    others = (placement(moved(0, 50.0), degenerate=ALONG_X), placement(moved(0, 60.0)))
    found = registration(Status.AMBIGUOUS, moved(7.0, 0.1), *others)
    step = choose(found, standing, PERIOD_NS, STILL, as_it_is)
    assert step.note == 'degenerate: predicted along (1.00, 0.00, 0.00)'
    assert abs(step.T_reference_sensor[0, 3]) < 1e-6
    # its own come first, where there are any
    found = replace(found, degenerate=ABOUT_Z, T_target_source=moved(0.1, yaw_deg=90))
    step = choose(found, standing, PERIOD_NS, STILL, as_it_is)
    assert step.note == 'degenerate: predicted along the turn about (0.00, 0.00, 1.00)'


def test_a_registration_is_likely_within_the_gate(standing):
    """Where it was predicted but for what it leaves open."""
    limit = np.sqrt(GATE * (0.1**2 + 0.01**2))
    for x, free, likely in ((limit - 0.001, NO_DIRECTION, True),
                            (limit + 0.001, NO_DIRECTION, False), (9.0, ALONG_X, True)):
        found = registration(Status.REGISTERED, moved(x), degenerate=free)
        assert is_likely(found, standing) is likely
    # without a covariance it is taken for one of 0.1 m
    limit = np.sqrt(GATE * 0.02)
    for x, likely in ((limit - 0.001, True), (limit + 0.001, False)):
        found = registration(Status.REGISTERED, moved(x), covariance=None)
        assert is_likely(found, standing) is likely


def test_information_is_the_inverse_of_the_covariance():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6))
    covariance = A @ A.T + np.eye(6)
    np.testing.assert_allclose(_information(placement(np.eye(4), covariance)) @ covariance,
                               np.eye(6), atol=1e-12)
    both = _information(placement(np.eye(4), covariance), np.eye(6))
    np.testing.assert_allclose(both @ (covariance + np.eye(6)), np.eye(6), atol=1e-12)


def test_information_of_what_comes_without_a_covariance():
    """A tenth of a metre and ten mrad."""
    np.testing.assert_allclose(_information(placement(np.eye(4), None)),
                               np.diag([100.0] * 3 + [10000.0] * 3))


def test_there_is_no_information_along_free_directions():
    covariance = np.diag([1.0, 4, 9, 0.01, 0.04, 0.09])
    free = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 1, 0]])
    np.testing.assert_allclose(_information(placement(np.eye(4), covariance, free)),
                               np.diag([0, 1 / 4, 1 / 9, 100, 0, 1 / 0.09]), atol=1e-12)
    # one direction twice, and another that both make up, are no more than those two
    more = np.vstack((free, free[0], (free[0] + free[1]) / np.sqrt(2)))
    np.testing.assert_allclose(_information(placement(np.eye(4), covariance, more)),
                               np.diag([0, 1 / 4, 1 / 9, 100, 0, 1 / 0.09]), atol=1e-9)


@pytest.mark.parametrize('variance', [1e-12, 1e-20])
def test_free_directions_weigh_alike_whatever_their_covariance(variance):
    """A turn known to 1e-10 rad hides no shift that is free as well."""
    covariance = np.diag([1.0] * 3 + [variance] * 3)
    found = _information(placement(np.eye(4), covariance, np.vstack((ALONG_X, ABOUT_Z))))
    np.testing.assert_allclose(np.diag(found), [0, 1, 1, 1 / variance, 1 / variance, 0],
                               rtol=1e-6, atol=1e-6)


def test_information_of_correlated_errors_along_a_free_direction():
    """What is left is that of the other directions alone: the marginal is what was measured."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(6, 6))
    covariance = A @ A.T + 0.1 * np.eye(6)
    found = _information(placement(np.eye(4), covariance, ALONG_X))
    np.testing.assert_allclose(found[0], 0, atol=1e-12)
    np.testing.assert_allclose(found[1:, 1:], np.linalg.inv(covariance[1:, 1:]), rtol=1e-9)


@pytest.mark.parametrize(('directions', 'words'), [
    (NO_DIRECTION, ''), (ALONG_X, ' along (1.00, 0.00, 0.00)'),
    (ABOUT_Z, ' along the turn about (0.00, 0.00, 1.00)'),
    ([[0, 0.6, 0.8, 0, 0, 0.1], [0, 0, 0.6, 0.8, 0, 0], [0.1, 0, 0, 0.1, 0, 0]],
     ' along (0.00, 0.60, 0.80) and the turn about (0.80, 0.00, 0.00) and (0.10, 0.00, 0.00)')])
def test_directions_are_named(directions, words):
    assert _along(np.array(directions)) == words


@pytest.fixture(scope='module')
def scans(street):
    return [preprocess(SemanticScan(points, labels)) for points, labels, _ in street[:2]]


def test_a_placement_is_refined_by_gicp_with_the_covariance_of_that(scans, street):
    """Unless it is loose: what is unknown stays unknown, by direction or by covariance."""
    source, target = scans[1], scans[0]
    truth = np.linalg.inv(street[0][2]) @ street[1][2]
    config = SgorConfig()
    rough = truth @ moved(0.2, 0.1)
    local = align(source.surface, target.surface, rough, config)
    found = refined(placement(rough), source, target, config)
    np.testing.assert_array_equal(found.T_target_source, local.T_target_source)
    np.testing.assert_array_equal(found.covariance, local.covariance)
    wide = np.diag([25.0, 1e-4, 1e-4] + [1e-6] * 3)
    for covariance, free in ((COVARIANCE, ALONG_X), (wide, NO_DIRECTION)):
        loose = refined(placement(rough, covariance, free), source, target, config)
        np.testing.assert_array_equal(loose.T_target_source, local.T_target_source)
        assert loose.covariance is covariance
        assert loose.degenerate is free


def test_scans_of_another_scale_are_refined_at_the_coarser(scans, street):
    """The reach of GICP is scaled by it."""
    rough = np.linalg.inv(street[0][2]) @ street[1][2] @ moved(0.2, 0.1)
    for scales, scale in (((0.5, 0.25), 0.5), ((0.25, 0.5), 0.5), ((1.0, 1.0), 1.0)):
        source, target = (replace(scan, scale=s)
                          for scan, s in zip(scans[::-1], scales, strict=True))
        local = align(source.surface, target.surface, rough, SgorConfig().scaled(scale))
        found = refined(placement(rough), source, target, SgorConfig())
        np.testing.assert_array_equal(found.T_target_source, local.T_target_source)


@pytest.mark.parametrize('which', [0, 1])
def test_without_a_surface_a_placement_stays_as_it_is(scans, which):
    pair = list(scans)
    pair[which] = replace(pair[which], surfaced=Lazy(lambda: None))
    given = placement(moved(1.0))
    assert refined(given, *pair, SgorConfig()) is given


def test_a_square_root_is_symmetric_and_squares_to_the_covariance():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6))
    root = square_root(A @ A.T)
    np.testing.assert_allclose(root, root.T, atol=1e-12)
    np.testing.assert_allclose(root @ root, A @ A.T, atol=1e-12)
    # rounding makes zero a little less than zero
    np.testing.assert_allclose(square_root(np.diag([4.0, -1e-18, 0, 0, 0, 9.0])),
                               np.diag([2.0, 0, 0, 0, 0, 3.0]), atol=1e-12)
