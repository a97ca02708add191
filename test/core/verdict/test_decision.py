"""From the results of the stages to a verdict: each field of each status, by hand."""
from dataclasses import replace

from galleries import dense
from galleries import gallery
from galleries import index_of
from galleries import moved
from galleries import NOTHING
import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.degeneracy.directions import DegenerateDirection
from sgor_ros.core.degeneracy.directions import inflated
from sgor_ros.core.features.features import Features
from sgor_ros.core.hypotheses.competing import HypothesisTest
from sgor_ros.core.icp.gicp import Alignment
from sgor_ros.core.matching.correspondences import Correspondences
from sgor_ros.core.scan.ground import Ground
from sgor_ros.core.scoring.pose_scoring import pose_score
from sgor_ros.core.scoring.pose_scoring import PoseScore
from sgor_ros.core.scoring.pose_scoring import score_keypoints
from sgor_ros.core.solver.solution import Solution
from sgor_ros.core.verdict.decision import decide
from sgor_ros.core.verdict.decision import decide_by_matches
from sgor_ros.core.verdict.decision import low_confidence
from sgor_ros.core.verdict.decision import no_solution
from sgor_ros.core.verdict.decision import Pair
from sgor_ros.core.verdict.decision import refuse
from sgor_ros.core.verdict.result import Status

CONFIG = SgorConfig(tau_1=0.5)
COVARIANCE = np.diag([1e-4] * 3 + [1e-6] * 3)
REPEATED = np.diag([1e-3] * 3 + [1e-4] * 3)
SLIDE = DegenerateDirection(np.array([1.0, 0, 0, 0, 0, 0]), 10.0, 20.0)
CONFIDENCE = 1 / (1 + np.exp(8.34 + 3.34 * np.log(0.005)))
TIMINGS = {'alignment': 0.1}


@pytest.fixture(scope='module')
def prepared():
    """Return a scan of a gallery with one pillar: 2,900 keypoints, all without a label."""
    points, normals = gallery(pitch=200.0, offset=3.0)
    scan = preprocess(SemanticScan(dense(points, normals)), SgorConfig())
    return replace(scan, index=index_of(points, normals), warnings=())


def labelled(scan, label):
    labels = np.full(5, label, np.uint8)
    return replace(scan, features=Features(np.zeros((5, 3)), labels, labels,
                                           np.zeros((5, 3), np.float32)))


def solution_of(source, target, T=None, inliers=None, hypotheses=NOTHING, reason=''):
    none = np.zeros(len(source), np.uint8)
    return Solution(
        Correspondences(source, target, none, none, none, none), T,
        np.zeros(len(source), np.bool_) if inliers is None else np.array(inliers), reason,
        np.array(hypotheses), np.ones(len(hypotheses), np.bool_), np.zeros(len(hypotheses)), 0)


@pytest.fixture
def pair(prepared):
    """Return the scan twice with matches that lie 0, 0.4, 0.5 and 3 m apart where they are."""
    source = np.zeros((4, 3))
    target = np.array([[0.0, 0, 0], [0.4, 0, 0], [0, 0.5, 0], [3, 0, 0]])
    grounds = [Ground(np.array([0.0, 0, 1]), height, np.zeros(0, np.bool_), 'geometry')
               for height in (1.7, 1.8)]
    return Pair(replace(prepared, ground=grounds[0], warnings=('a', 'b')),
                replace(prepared, ground=grounds[1], warnings=('c',)), source, target,
                solution_of(source, target, np.eye(4), inliers=[False] * 4), TIMINGS)


def outcomes_at(pair, T):
    return score_keypoints(pair.source.index, pair.target.index, np.array(T)[None], 1000)[0]


def verified(pair, *competing, T=None, outcomes=None, degenerate=()):
    """Return a test of a pose; those that compete explain what it explains."""
    T = np.eye(4) if T is None else T
    own = outcomes_at(pair, T)
    rows = np.tile(own, (len(competing), 1)) if outcomes is None else np.array(outcomes)
    return HypothesisTest(T, own, np.array(competing).reshape(-1, 4, 4), rows, degenerate)


def aligned(T=None, covariance=COVARIANCE):
    return Alignment(np.eye(4) if T is None else T, covariance, REPEATED, True, 100)


def assert_of_the_pair(result, pair):
    """What every verdict hands on."""
    assert result.source_points is pair.source_points
    assert result.target_points is pair.target_points
    assert result.solution is pair.solution
    assert result.source_ground is pair.source.ground
    assert result.target_ground is pair.target.ground
    assert result.timings is TIMINGS
    assert result.warnings == ('source: a', 'source: b', 'target: c')


def assert_alone(result):
    assert result.alternatives == ()
    assert result.degenerate.shape == (0, 6)


def test_registered_is_the_pose_of_the_alignment(pair):
    """Scored anew, with the matches that agree with it, nearer than tau_1."""
    alignment = aligned(moved(0.01))
    test = replace(verified(pair), outcomes=np.zeros(2000, np.int8))
    result = decide(pair, test, alignment, CONFIG)
    assert result.status is Status.REGISTERED
    assert result.success
    assert result.reason == ''
    assert result.T_target_source is alignment.T_target_source
    assert result.inliers.tolist() == [True, True, False, False]
    assert result.score == pose_score(outcomes_at(pair, moved(0.01)))
    assert result.score.overlap == 1.0
    assert result.confidence == result.score.confidence == CONFIDENCE
    assert result.covariance is COVARIANCE
    assert result.correlated_error is REPEATED
    assert_alone(result)
    assert_of_the_pair(result, pair)


def test_without_an_alignment_the_tested_pose_stands_without_a_covariance(pair):
    test = verified(pair, T=moved(0.02))
    result = decide(pair, test, None, CONFIG)
    assert result.status is Status.REGISTERED
    assert result.T_target_source is test.T_target_source
    assert result.covariance is None
    assert result.correlated_error is None
    assert result.confidence == CONFIDENCE


def test_inliers_are_nearer_than_tau_1(pair):
    """Exactly half a metre is not nearer than half a metre."""
    assert decide(pair, verified(pair), aligned(), CONFIG).inliers.tolist() == [
        True, True, False, False]
    assert decide(pair, verified(pair), aligned(), SgorConfig(tau_1=0.6)).inliers.tolist() == [
        True, True, True, False]


def test_refused_below_min_confidence_whatever_competes_or_slides(pair):
    """No alternatives, no directions, no widened covariance for what is not believed."""
    config = CONFIG.replace(min_confidence=1.0)
    result = decide(pair, verified(pair, moved(8), degenerate=(SLIDE,)), aligned(), config)
    assert result.status is Status.REFUSED
    assert result.reason == ('confidence 1.00 is below min_confidence 1.00: of the keypoints '
                             '100% agree, 0.0% contradict')
    assert result.T_target_source is not None
    assert result.confidence == CONFIDENCE
    assert result.score == PoseScore(1.0, 0.0)
    assert result.covariance is COVARIANCE
    assert result.correlated_error is REPEATED
    assert_alone(result)
    assert_of_the_pair(result, pair)


def test_min_confidence_itself_is_enough(pair):
    config = CONFIG.replace(min_confidence=CONFIDENCE)
    assert decide(pair, verified(pair), aligned(), config).status is Status.REGISTERED


def test_an_alignment_that_went_astray_is_refused(pair):
    """It is the aligned pose that is scored: 5 m off, among the walls of the other."""
    result = decide(pair, verified(pair), aligned(moved(0, 3.0, 0, 20)), CONFIG)
    assert result.status is Status.REFUSED
    assert result.confidence < 0.5
    assert result.score == pose_score(outcomes_at(pair, moved(0, 3.0, 0, 20)))


def test_ambiguous_where_other_poses_stand(pair):
    """Two of four: one is the answer itself, one is ruled out by 20 violations."""
    own = outcomes_at(pair, np.eye(4))
    hidden, guilty = own.copy(), own.copy()
    hidden[:200] = 0
    guilty[:20] = -1
    test = verified(pair, moved(8), moved(0.1), moved(16), moved(-8, yaw_deg=180),
                  outcomes=[hidden, own, guilty, own])
    result = decide(pair, test, aligned(), CONFIG)
    assert result.status is Status.AMBIGUOUS
    assert not result.success
    assert result.reason == ('ambiguous: 3 placements explain the scans equally well, the next '
                             '8.0 m apart along (1.00, 0.00, 0.00)')
    np.testing.assert_array_equal(result.T_target_source, np.eye(4))
    np.testing.assert_array_equal([other.T_target_source for other in result.alternatives],
                                  [moved(8), moved(-8, yaw_deg=180)])
    assert [other.score for other in result.alternatives] == [PoseScore(0.9, 0.0),
                                                              PoseScore(1.0, 0.0)]
    for other in result.alternatives:
        np.testing.assert_array_equal(other.covariance, COVARIANCE)
        assert other.degenerate.shape == (0, 6)
    assert result.confidence == pytest.approx(CONFIDENCE / 3)
    assert result.score == PoseScore(1.0, 0.0)
    np.testing.assert_array_equal(result.covariance, COVARIANCE)
    assert result.correlated_error is REPEATED
    assert result.degenerate.shape == (0, 6)
    assert_of_the_pair(result, pair)


def test_ambiguous_and_sliding_is_ambiguous(pair):
    """The directions are those of each alternative; both covariances are as wide as they say."""
    test = verified(pair, moved(0, 1, yaw_deg=180), degenerate=(SLIDE, SLIDE))
    result = decide(pair, test, aligned(), CONFIG)
    assert result.status is Status.AMBIGUOUS
    assert result.degenerate.shape == (0, 6)
    other, = result.alternatives
    np.testing.assert_array_equal(other.degenerate, [SLIDE.twist])
    wide = inflated(COVARIANCE, (SLIDE, SLIDE))
    np.testing.assert_array_equal(result.covariance, wide)
    np.testing.assert_array_equal(other.covariance, wide)
    assert wide[0, 0] > 200
    assert result.confidence == pytest.approx(CONFIDENCE / 2)


def test_without_a_covariance_none_of_the_alternatives_has_one(pair):
    result = decide(pair, verified(pair, moved(8), degenerate=(SLIDE,)), None, CONFIG)
    assert result.status is Status.AMBIGUOUS
    assert result.covariance is result.alternatives[0].covariance is None


@pytest.mark.parametrize(('other', 'words'), [
    (moved(0, -6, 8), 'the next 10.0 m apart along (0.00, -0.60, 0.80)'),
    (moved(0, 0.8), 'the next 0.8 m apart along (0.00, 1.00, 0.00)'),
    (moved(8, yaw_deg=4.9), 'the next 8.0 m apart along (1.00, 0.00, 0.00)'),
    (moved(8, yaw_deg=5.4), 'the next 8.0 m apart along (1.00, 0.00, 0.00), turned by 5 deg'),
    (moved(8, yaw_deg=-6), 'the next 8.0 m apart along (1.00, 0.00, 0.00), turned by 6 deg'),
    (moved(yaw_deg=180), 'the next 0.0 m apart along (0.00, 0.00, 0.00), turned by 180 deg')])
def test_the_reason_says_where_the_best_of_the_others_lies(pair, other, words):
    result = decide(pair, verified(pair, other, moved(33)), aligned(), CONFIG)
    assert result.reason == f'ambiguous: 3 placements explain the scans equally well, {words}'


def test_the_gap_is_that_to_the_pose_of_the_alignment(pair):
    T = moved(0.1, yaw_deg=0.2)
    result = decide(pair, verified(pair, moved(8.1, yaw_deg=5.1)), aligned(T), CONFIG)
    assert 'the next 8.0 m apart along (1.00, 0.00, 0.00)' in result.reason
    assert 'turned' not in result.reason


@pytest.mark.parametrize(('sigmas', 'share'), [
    ((10.0,), 0.06), ((10.0, 3.0), 0.06 * 0.2), ((0.3,), 1.0), ((0.3, 6.0), 0.1)])
def test_degenerate_where_the_clouds_slide(pair, sigmas, share):
    """Confidence: what is known of where, in maximum correspondence distances (0.6 m)."""
    axes = np.eye(6)[:2]
    free = tuple(DegenerateDirection(axis, sigma, 20.0)
                 for axis, sigma in zip(axes, sigmas, strict=False))
    result = decide(pair, verified(pair, degenerate=free), aligned(), CONFIG)
    assert result.status is Status.DEGENERATE
    assert not result.success
    np.testing.assert_array_equal(result.T_target_source, np.eye(4))
    assert result.inliers.tolist() == [True, True, False, False]
    assert result.reason == 'degenerate: the clouds ' + ' and '.join(
        ('slide along (1.00, 0.00, 0.00)', 'slide along (0.00, 1.00, 0.00)')[:len(free)])
    np.testing.assert_array_equal(result.degenerate, axes[:len(free)])
    np.testing.assert_array_equal(result.covariance, inflated(COVARIANCE, free))
    assert result.correlated_error is REPEATED
    assert result.confidence == pytest.approx(CONFIDENCE * share)
    assert result.score == PoseScore(1.0, 0.0)
    assert result.alternatives == ()
    assert_of_the_pair(result, pair)


def test_degenerate_without_an_alignment_has_no_covariance(pair):
    result = decide(pair, verified(pair, degenerate=(SLIDE,)), None, CONFIG)
    assert result.status is Status.DEGENERATE
    assert result.covariance is result.correlated_error is None


def test_what_competes_and_does_not_differ_is_no_ambiguity(pair):
    """Nor is what the clouds rule out; the slide still counts."""
    own = outcomes_at(pair, np.eye(4))
    test = verified(pair, moved(0.1), moved(9), outcomes=[own, 0 * own], degenerate=(SLIDE,))
    assert decide(pair, test, aligned(), CONFIG).status is Status.DEGENERATE
    test = replace(test, degenerate=())
    assert decide(pair, test, aligned(), CONFIG).status is Status.REGISTERED


def test_refuse_keeps_the_tested_pose(pair):
    own = np.array([1] * 6 + [-1] * 2 + [0] * 2, np.int8)
    test = replace(verified(pair, moved(8), T=moved(0.45)), outcomes=own)
    result = refuse(pair, test, 'too far', CONFIG)
    assert result.status is Status.REFUSED
    assert result.reason == 'too far'
    assert result.T_target_source is test.T_target_source
    assert result.inliers.tolist() == [True, True, False, False]
    assert result.score == PoseScore(0.6, 0.2)
    assert result.confidence == pytest.approx(
        1 / (1 + np.exp(8.34 - 2.85 * np.log(0.6) + 3.34 * np.log(0.205))))
    assert result.covariance is result.correlated_error is None
    assert_alone(result)
    assert_of_the_pair(result, pair)


def test_no_solution_has_no_pose(pair):
    inliers = np.array([True, False, False, True])
    solution = replace(pair.solution, T_target_source=None, inliers=inliers, reason='too few')
    pair = replace(pair, solution=solution)
    result = no_solution(pair, CONFIG)
    assert result.status is Status.NO_SOLUTION
    assert result.reason == 'too few'
    assert result.T_target_source is result.score is result.covariance is None
    assert result.correlated_error is None
    assert result.inliers is inliers
    assert result.confidence == 0.0
    assert_alone(result)
    assert_of_the_pair(result, pair)


@pytest.mark.parametrize(('source', 'target', 'words'), [
    (13, 0, ('labels ignored: the target has none',)),
    (0, 13, ('labels ignored: the source has none',)), (13, 18, ()), (0, 0, ())])
def test_labels_that_one_scan_lacks_are_ignored_with_a_warning(prepared, source, target, words):
    points = np.zeros((1, 3))
    pair = Pair(labelled(prepared, source), labelled(prepared, target), points, points,
                solution_of(points, points), TIMINGS)
    assert no_solution(pair, CONFIG).warnings == words
    pair = replace(pair, source=replace(pair.source, warnings=('odd',)))
    assert no_solution(pair, CONFIG).warnings == ('source: odd', *words)


def test_low_confidence_in_words():
    assert low_confidence(PoseScore(0.254, 0.0316), SgorConfig(min_confidence=0.9)) == (
        'confidence 0.23 is below min_confidence 0.90: of the keypoints 25% agree, 3.2% '
        'contradict')


def test_the_verdict_on_matches_weighs_the_inliers_against_the_next_hypothesis():
    """Six inliers; outside them one hypothesis explains three, another two: six of nine."""
    rng = np.random.default_rng(0)
    source = rng.uniform(-20, 20, (12, 3))
    shifts = np.array([0.0] * 6 + [8.0] * 3 + [-8.0] * 2 + [99.0])
    target = source + shifts[:, None] * [1, 0, 0]
    inliers = shifts == 0
    # the hypothesis of the inliers themselves explains nothing outside
    solution = solution_of(source, target, np.eye(4), inliers, [
        np.eye(4), moved(-8.3), moved(8.3), moved(50)], 'said')
    result = decide_by_matches(solution, CONFIG, TIMINGS)
    assert result.status is Status.REGISTERED
    assert result.reason == 'said'
    assert result.T_target_source is solution.T_target_source
    assert result.source_points is solution.correspondences.source
    assert result.target_points is solution.correspondences.target
    assert result.inliers is solution.inliers
    assert result.confidence == 6 / 9
    assert result.solution is solution
    assert result.timings is TIMINGS
    assert result.score is result.covariance is result.correlated_error is None
    assert result.warnings == ()
    assert_alone(result)
    # farther than tau_1 they explain nothing
    narrow = decide_by_matches(solution, CONFIG.replace(tau_1=0.25), TIMINGS)
    assert narrow.confidence == 1.0


def test_the_verdict_on_matches_without_a_pose():
    points = np.zeros((4, 3))
    solution = solution_of(points, points, None, None, [np.eye(4)], 'none')
    result = decide_by_matches(solution, CONFIG, TIMINGS)
    assert result.status is Status.NO_SOLUTION
    assert result.reason == 'none'
    assert result.T_target_source is None
    assert result.confidence == 0.0


def test_the_verdict_on_matches_of_which_none_agrees():
    """Nothing explained, inside or outside: nothing speaks for it."""
    points = np.zeros((4, 3))
    solution = solution_of(points, points + [9, 0, 0], np.eye(4), None, NOTHING)
    assert decide_by_matches(solution, CONFIG, TIMINGS).confidence == 0.0
    for count in (1, 4):
        inliers = np.arange(4) < count
        solution = solution_of(points, points, np.eye(4), inliers, NOTHING)
        assert decide_by_matches(solution, CONFIG, TIMINGS).confidence == 1.0
