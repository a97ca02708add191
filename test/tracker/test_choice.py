"""What the motion so far makes of registrations that cannot stand alone: made by hand."""
from dataclasses import replace

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import preprocess
from sgor_ros import Registration
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import State
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.core.common import se3
from sgor_ros.core.degeneracy.directions import DegenerateDirection
from sgor_ros.core.degeneracy.directions import independent
from sgor_ros.core.verdict.result import Placement
from sgor_ros.core.verdict.result import Status
from sgor_ros.tracker import scan_registration
from sgor_ros.tracker import tracker as tracker_module
from sgor_ros.tracker.choice import _information
from sgor_ros.tracker.choice import choose as choose_refined
from sgor_ros.tracker.choice import refined
from sgor_ros.tracker.choice import Step
from sgor_ros.tracker.motion import Motion

PERIOD_NS = 100_000_000
CONFIG = TrackerConfig()
COVARIANCE = np.diag([0.005**2] * 3 + [0.0003**2] * 3)
ALONG_X = np.array([[1.0, 0, 0, 0, 0, 0]])
BOUND = 20.06


def pose(x, y=0.0, z=0.0, yaw=0.0):
    return se3.compose(Rotation.from_euler('z', yaw).as_matrix(), np.array([x, y, z]))


def registration(T, *others, success=False, degenerate=None, covariance=COVARIANCE):
    """Return what is known of a pair whose placements are T and others."""
    free = np.empty((0, 6)) if degenerate is None else degenerate
    status = (Status.REGISTERED if success else Status.AMBIGUOUS if others
              else Status.DEGENERATE if len(free) else Status.REFUSED)
    return Registration(
        status, '' if success else 'not alone', T, np.zeros((20, 3)), np.zeros((20, 3)),
        np.ones(20, np.bool_), 1.0, covariance, degenerate=free,
        alternatives=tuple(Placement(other, covariance, free) for other in others))


def choose(*given):
    """Choose among placements that need no refinement."""
    return choose_refined(*given, refine=lambda placement: placement)


@pytest.fixture
def driving():
    """Return a motion at 8 m/s that is 2.4 m from its reference, and the stamp of the next scan.
    """
    motion = Motion.unknown(0, np.eye(4), np.zeros((6, 6)), CONFIG)
    for k in range(1, 4):
        motion = motion.measured(k * PERIOD_NS, pose(0.8 * k), COVARIANCE)
    return motion, 4 * PERIOD_NS


def test_a_result_that_stands_alone_is_taken_as_it_is(driving):
    T = pose(3.1, 0.05)
    step = choose(registration(T, success=True), *driving, CONFIG)
    assert step.T_reference_sensor is T
    assert step.covariance is COVARIANCE
    assert step.fused is None
    assert step.note == ''


def test_a_refused_result_stays_refused(driving):
    assert choose(registration(pose(3.2)), *driving, CONFIG) == 'not alone'


@pytest.mark.parametrize('order', [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_of_lamps_twelve_metres_apart_the_motion_knows_which(driving, order):
    """Whichever looks best to the clouds: 8 m/s leads to one of them."""
    placements = [pose(3.2, 0.01), pose(15.2), pose(-8.8)]
    step = choose(registration(*(placements[k] for k in order)), *driving, CONFIG)
    assert step.T_reference_sensor is placements[0]
    np.testing.assert_array_equal(step.covariance, COVARIANCE)
    assert 'ambiguous' in step.note


def test_lamps_from_the_first_step_on(driving):
    """Nothing is known of the velocity, but 12 m in 0.1 s is too fast for anything."""
    motion = Motion.unknown(0, np.eye(4), np.zeros((6, 6)), CONFIG)
    step = choose(registration(pose(12.8), pose(0.8), pose(-11.2)), motion, PERIOD_NS, CONFIG)
    np.testing.assert_array_equal(step.T_reference_sensor, pose(0.8))


@pytest.mark.parametrize(('placements', 'words'), [
    ([pose(3.2), pose(3.3), pose(15.0)], '2 of 3 placements would fit'),
    ([pose(9.2), pose(-2.8)], 'none of 2 placements would fit'),
    ([pose(3.2, yaw=np.pi), pose(9.2)], 'none of 2 placements would fit')])
def test_two_or_none_that_fit_are_no_pose(driving, placements, words):
    assert words in choose(registration(*placements), *driving, CONFIG)


def test_ambiguous_and_sliding_measures_nothing_along_the_slide(driving):
    """The best placement slides as its rivals do: scan after scan, no doubt is taken away."""
    motion, stamp_ns = driving
    wide = np.diag([11.0**2, *np.diag(COVARIANCE)[1:]])
    found = registration(pose(2.0, 0.02), pose(3.0, yaw=np.pi), degenerate=ALONG_X,
                         covariance=wide)
    for _ in range(20):
        step = choose(replace(found, degenerate=np.empty((0, 6))), motion, stamp_ns, CONFIG)
        predicted = motion.predict(stamp_ns, CONFIG)
        assert step.covariance[0, 0] == pytest.approx(predicted.covariance[0, 0], rel=1e-6)
        motion, stamp_ns = step.fused, stamp_ns + PERIOD_NS
    assert np.sqrt(step.covariance[0, 0]) > 1.0


def test_after_a_while_without_a_pose_more_would_fit(driving):
    """The prediction of 0.1 s tells 3 m apart, that of 2 s does not."""
    motion, stamp_ns = driving
    near, far = pose(3.2), pose(6.2)
    assert isinstance(choose(registration(near, far), motion, stamp_ns, CONFIG), Step)
    later = stamp_ns + 19 * PERIOD_NS
    at = 19 * 0.8
    assert '2 of 2' in choose(registration(pose(3.2 + at), pose(6.2 + at)), motion, later, CONFIG)


@pytest.mark.parametrize('covariance', [COVARIANCE, np.diag([25.0, *np.diag(COVARIANCE)[1:]])])
def test_a_free_direction_is_predicted_and_the_others_are_measured(driving, covariance):
    """The clouds slid back to where they began: along x the motion counts, across it they do."""
    found = registration(pose(0.0, 0.15, -0.05, 0.01), degenerate=ALONG_X, covariance=covariance)
    step = choose(found, *driving, CONFIG)
    np.testing.assert_allclose(step.T_reference_sensor, pose(3.2, 0.15, -0.05, 0.01), atol=0.01)
    sigma = np.sqrt(np.diag(step.covariance))
    assert sigma[0] > 0.05, 'nobody measured it'
    assert (sigma[1:3] < 0.006).all()
    assert step.note == 'degenerate: predicted along (1.00, 0.00, 0.00)'


def test_a_loose_covariance_is_predicted_too_where_no_direction_is_named(driving):
    loose = COVARIANCE + 25.0 * np.outer(ALONG_X, ALONG_X)
    step = choose(registration(pose(0.0, 0.05), pose(0.0, 9.0), covariance=loose), *driving,
                  CONFIG)
    np.testing.assert_allclose(step.T_reference_sensor, pose(3.2, 0.05), atol=0.01)
    assert step.fused is not None


def test_an_alternative_is_refined_before_it_is_believed(street):
    """0.3 m off, as the search for rivals leaves it, with a covariance of the best one."""
    target, source = (preprocess(SemanticScan(points, labels))
                      for points, labels, _ in street[:2])
    truth = relative(street[0][2], street[1][2])
    rough = truth @ pose(0.3, 0.1, 0.0, 0.01)
    motion = Motion.unknown(0, np.eye(4), np.zeros((6, 6)), CONFIG)
    step = choose_refined(
        registration(pose(40.0), rough), motion, PERIOD_NS, CONFIG,
        lambda placement: refined(placement, source, target, SgorConfig()))
    assert errors(step.T_reference_sensor, truth)[0] < 0.03
    assert np.trace(step.covariance) < 1e-3
    assert refined(Placement(rough, None, np.empty((0, 6)), {}), source, target, SgorConfig()
                   ).covariance is not None


def test_a_degenerate_result_that_contradicts_the_motion_is_no_pose(driving):
    found = registration(pose(3.2, 2.0), degenerate=ALONG_X)
    assert 'none of 1 placement would fit' in choose(found, *driving, CONFIG)


def test_a_free_turn_is_predicted(driving):
    """A round shaft: the yaw is free, the place is not."""
    free = np.array([[0.0, 0, 0, 0, 0, 1]])
    step = choose(registration(pose(3.2, yaw=2.0), degenerate=free), *driving, CONFIG)
    np.testing.assert_allclose(step.T_reference_sensor, pose(3.2), atol=0.01)
    assert 'the turn about (0.00, 0.00, 1.00)' in step.note
    assert step.covariance[5, 5] > 10 * COVARIANCE[5, 5]


class Tunnel:
    """A drive with changing speed; scans 5 to 79 slide along the axis of their reference."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.poses = [np.eye(4)]
        speed, acceleration = 8.0, 0.0
        for k in range(89):
            acceleration = 0.95 * acceleration + self.rng.normal(0, 0.5)
            speed = max(0.0, speed + 0.1 * acceleration)
            twist = np.array([speed, 0, 0, 0, 0, 0.02 * speed * np.sin(0.05 * k)])
            self.poses.append(self.poses[-1] @ se3.exp(0.1 * twist))

    def truth(self, scan, reference):
        return se3.inverse(self.poses[reference]) @ self.poses[scan]

    def register(self, scan, reference):
        noise = self.rng.multivariate_normal(np.zeros(6), COVARIANCE)
        T = se3.perturbed(self.truth(scan, reference), noise)
        if not 5 <= scan < 80:
            return registration(T, success=True)
        T[0, 3] = 0.0    # as if it stood
        return registration(T, degenerate=ALONG_X,
                            covariance=COVARIANCE + 25.0 * np.outer(ALONG_X, ALONG_X))


@pytest.mark.parametrize('seed', [0, 1, 2])
@pytest.mark.parametrize('mode', ['consecutive', 'keyframe'])
def test_through_a_tunnel_the_covariance_says_what_is_not_known(monkeypatch, mode, seed):
    """Predicted for 7 s, the pose is off by metres, and metres are what it claims."""
    tunnel = Tunnel(seed)
    rng = np.random.default_rng(0)
    scan = SemanticScan(rng.uniform([-20, -20, -2], [20, 20, 6], (3000, 3)))
    prepared = preprocess(scan)
    number = {}

    def prepare(_, config, scale_before=None, up_before=None):
        copy = type(prepared)(**{**vars(prepared), 'config': config})
        number[id(copy)] = len(number)
        kept.append(copy)
        return copy

    kept = []
    monkeypatch.setattr(tracker_module, 'preprocess', prepare)
    monkeypatch.setattr(scan_registration, 'register', lambda source, target, _: tunnel.register(
        number[id(source)], number[id(target)]))
    # here are no clouds to test a prediction on
    tracker = Tracker(tracker_config=TrackerConfig(mode=mode, predict_first=False))
    results = [tracker.track(scan, k * PERIOD_NS) for k in range(90)]
    assert [r.state for r in results] == [
        State.NEW_TRACK, *[State.TRACKING] * 4, *[State.DEGENERATE] * 75, *[State.TRACKING] * 10]
    assert all(any('degenerate: predicted' in w for w in r.warnings) for r in results[5:80])
    inside = []
    for k, result in enumerate(results[1:], 1):
        for T, truth, covariance in (
                (result.T_odom_sensor, tunnel.poses[k], result.covariance),
                (result.T_reference_sensor,
                 tunnel.truth(k, result.reference_stamp_ns // PERIOD_NS),
                 result.reference_covariance)):
            np.linalg.cholesky(covariance)
            error = se3.perturbation(T, truth)
            inside.append(error @ np.linalg.solve(covariance, error) < BOUND)
    assert np.mean(inside) > 0.97
    along = np.array([np.sqrt(r.covariance[0, 0]) for r in results])
    assert along[4] < 0.05
    assert (np.diff(along[5:80]) > 0).all()
    assert along[79] > 5.0
    assert (along[80:] > 5.0).all(), 'where it is since the start is not known again by leaving'


def twists_of_any_kind(rng):
    """Return free directions as they come of clouds, or worse: shifts and turns, any number."""
    count = rng.integers(1, 7)
    twists = rng.normal(size=(count, 6))
    kind = rng.integers(5)
    if kind == 0:    # shifts in one plane
        twists[:, 2:] = 0
    elif kind == 1:    # nearly one line
        twists = twists[:1] + 10.0**rng.uniform(-17, -1) * rng.normal(size=(count, 6))
    elif kind == 2:    # turns only
        twists[:, :3] = 0
    elif kind == 3:    # some twice
        twists = twists[rng.integers(count, size=count)]
    twists[:, 3:] /= 10.0**rng.uniform(-1, 2)
    return twists


@pytest.mark.slow
def test_whatever_the_free_directions_are_the_information_is_one(driving):
    """Never an exception, nothing negative, and nothing along what is free."""
    rng = np.random.default_rng(0)
    motion, stamp_ns = driving
    prediction = motion.predict(stamp_ns, CONFIG)
    for _ in range(5000):
        twists = twists_of_any_kind(rng)
        root = rng.normal(size=(6, 6)) * np.repeat((0.05, 0.003), 3)[:, None]
        covariance = root @ root.T + np.diag([1e-8] * 3 + [1e-10] * 3)
        free = twists / np.linalg.norm(twists, axis=1, keepdims=True)
        information = _information(Placement(np.eye(4), covariance, free))
        values = np.linalg.eigvalsh(information)
        assert values[0] > -1e-9 * values[-1]
        along = np.einsum('ki,ij,kj->k', free, information, free)
        full = np.einsum('ki,ij,kj->k', free, np.linalg.inv(covariance), free)
        assert (along <= 1e-6 * full + 1e-9).all()
        T = pose(*rng.uniform(-5, 5, 3), rng.uniform(-3, 3))
        assert prediction.distance(T, information) >= 0
        fused = prediction.fuse(T, information)
        assert np.linalg.eigvalsh(fused.pose_covariance)[0] > -1e-9


def test_directions_that_leave_degeneracy_are_independent():
    rng = np.random.default_rng(1)
    for _ in range(2000):
        lever = 10.0**rng.uniform(0, 2)
        slides = tuple(DegenerateDirection(twist, 1.0, lever) for twist in twists_of_any_kind(rng))
        found = independent(slides)
        assert 1 <= len(found) <= 6
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
        metric = found * np.repeat((1.0, lever), 3)
        metric /= np.linalg.norm(metric, axis=1, keepdims=True)
        assert np.linalg.svd(metric)[1][-1] > 1e-4
    three = [np.array([np.cos(a), np.sin(a), 0, 0, 0, 0]) for a in (0.0, 1.0, 2.0)]
    found = independent(tuple(DegenerateDirection(twist, 1.0, 10.0) for twist in three))
    np.testing.assert_allclose(found, three[:2])


def test_two_clouds_of_heavy_rain_end_no_track(data_folder):
    """The free directions of their registration lay in one plane."""
    with np.load(data_folder / 'faults/rain40_two_clouds.npz') as file:
        clouds = [file[name] for name in file]
    tracker = Tracker()
    for k, cloud in enumerate(clouds):
        tracked = tracker.track(SemanticScan(cloud[:, :3]), (k + 1) * PERIOD_NS)
        assert 'fault' not in tracked.reason
    assert tracked.state is State.FAILED
    assert tracked.registration.status is Status.AMBIGUOUS
    assert {len(other.degenerate) for other in tracked.registration.alternatives} == {2}
    assert 'placements would fit the motion so far' in tracked.reason


def test_a_fault_of_the_program_costs_one_scan(street, monkeypatch, caplog):
    tracker = Tracker()
    scans = [SemanticScan(points, labels) for points, labels, _ in street]
    assert tracker.track(scans[0], PERIOD_NS).success

    def fail(*_, **__):
        raise np.linalg.LinAlgError('Singular matrix')
    with monkeypatch.context() as patch:
        patch.setattr(scan_registration, 'register', fail)
        failed = tracker.track(scans[1], 2 * PERIOD_NS)
    assert not failed.success
    assert failed.state is State.FAILED
    assert failed.failures == 1
    assert failed.reason == 'fault of the program: LinAlgError: Singular matrix'
    assert 'Traceback' in caplog.text
    after = tracker.track(scans[2], 3 * PERIOD_NS)
    assert after.success
    assert after.failures == 0
    assert errors(after.T_odom_sensor, relative(street[0][2], street[2][2]))[0] < 0.1
