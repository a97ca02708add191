"""From pairs to a track: what is registered to what, gaps, restarts, covariance and twist."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import State
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.core.common import se3
from sgor_ros.io.datasets import open_drives
from sgor_ros.tracker import keyframes as keyframes_module

PERIOD_NS = 100_000_000
MODES = ('consecutive', 'keyframe')
FAR = {'keyframe_distance': 100.0, 'keyframe_angle': 3.0, 'keyframe_overlap': 0.0}


@pytest.fixture(scope='module')
def scans(street):
    return [SemanticScan(points, labels) for points, labels, _ in street]


@pytest.fixture(scope='module')
def others(elsewhere):
    return [SemanticScan(points, labels) for points, labels, _ in elsewhere]


@pytest.fixture(scope='module')
def garbage(scans):
    """Return a scan of random points with labels of a street."""
    rng = np.random.default_rng(0)
    return SemanticScan(rng.uniform([-40, -40, -2], [40, 40, 8], (20000, 3)),
                        rng.choice(scans[0].labels, 20000))


def track(scans, tracker=None, stamps=None, period_ns=PERIOD_NS, **settings):
    """Return what becomes of scans 0.1 s apart."""
    tracker = tracker or Tracker(tracker_config=TrackerConfig(**settings))
    stamps = stamps or [i * period_ns for i in range(len(scans))]
    return [tracker.track(scan, stamp) for scan, stamp in zip(scans, stamps, strict=True)]


def spun(scan, yaw):
    """Return the scan of the sensor turned left by yaw, and T_old_new."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('z', yaw).as_matrix()
    return SemanticScan(scan.points @ T[:3, :3], scan.labels), T


def assert_near(T, truth, metres=0.1, degrees=0.3):
    found = errors(T, truth)
    assert found[0] < metres
    assert found[1] < degrees


@pytest.mark.parametrize('mode', MODES)
def test_poses_are_those_of_the_first_scan(scans, street, mode):
    """The first is the origin with no doubt about it; each next is where it was."""
    results = track(scans, mode=mode)
    np.testing.assert_array_equal(results[0].T_odom_sensor, np.eye(4))
    np.testing.assert_array_equal(results[0].covariance, np.zeros((6, 6)))
    assert results[0].restarted
    assert results[0].keyframe
    assert results[0].registration is None
    for i, result in enumerate(results):
        assert result.success
        assert result.stamp_ns == i * PERIOD_NS
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))
    assert not any(result.restarted for result in results[1:])


@pytest.mark.parametrize('mode', MODES)
def test_real_scans(data_folder, mode):
    """Ten scans of KITTI 08: the end within 0.3 m and 1 degree, none failed."""
    drive = next(d for d in open_drives(data_folder / 'kitti') if d.name.endswith('08'))
    results = track([frame.read() for frame in drive.scans[:10]], mode=mode)
    assert all(result.success for result in results)
    assert_near(results[-1].T_odom_sensor,
                relative(drive.T_world_sensor[0], drive.T_world_sensor[9]), 0.3, 1.0)


def test_consecutive_scans_are_registered_to_the_one_before(scans):
    results = track(scans, mode='consecutive')
    assert [r.reference_stamp_ns for r in results] == [None, 0, PERIOD_NS, 2 * PERIOD_NS]
    assert all(r.keyframe for r in results)


def references(results):
    """Return the index of the scan that each was registered to."""
    return [None if r.reference_stamp_ns is None else r.reference_stamp_ns // PERIOD_NS
            for r in results]


def test_a_keyframe_by_distance(scans):
    """Scans 1.5 m apart and keyframes beyond 2 m: every second is one."""
    results = track(scans, **{**FAR, 'keyframe_distance': 2.0})
    assert [r.keyframe for r in results] == [True, False, True, False]
    assert references(results) == [None, 0, 0, 2]
    assert references(track(scans, **FAR)) == [None, 0, 0, 0]


def test_a_keyframe_by_angle(scans):
    """Turned by 0.4 rad: beyond 0.35 it becomes one, below 0.5 it does not."""
    turned = [scans[0], spun(scans[1], 0.4)[0], scans[2]]
    assert references(track(turned, **{**FAR, 'keyframe_angle': 0.2})) == [None, 0, 1]
    assert references(track(turned, **{**FAR, 'keyframe_angle': 1.0})) == [None, 0, 0]


@pytest.mark.parametrize('predict_first', [True, False])
def test_a_keyframe_by_falling_overlap(scans, predict_first):
    """The share is that of the first scan after the keyframe; it falls on the way."""
    results = track(scans, **FAR, predict_first=predict_first)
    overlap = [r.registration.score.overlap for r in results[1:]]
    assert overlap[0] > overlap[1] > overlap[2]
    between = (overlap[1] + overlap[2]) / 2 / overlap[0]
    again = track(scans, **{**FAR, 'keyframe_overlap': between}, predict_first=predict_first)
    assert [r.keyframe for r in again] == [True, False, False, True]
    assert not any(r.keyframe for r in results[1:])


@pytest.mark.parametrize('mode', MODES)
def test_a_gap_is_bridged_without_a_jump(scans, street, garbage, mode):
    """The bad scan has no pose; the next is registered to the reference from before."""
    results = track([scans[0], scans[1], garbage, scans[2], scans[3]], mode=mode)
    assert [r.success for r in results] == [True, True, False, True, True]
    bad = results[2]
    assert bad.T_odom_sensor is bad.covariance is bad.twist is None
    assert bad.reason
    assert not bad.keyframe
    assert results[3].reference_stamp_ns == (PERIOD_NS if mode == 'consecutive' else 0)
    for result, i in ((results[3], 2), (results[4], 3)):
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))
        assert not result.restarted


@pytest.mark.parametrize('mode', MODES)
def test_carried_elsewhere_and_back_it_knows_where_it_is(scans, street, others, mode):
    """No pose while it is elsewhere, and the true one, not the last one, when it is back."""
    results = track([*scans[:2], *others, scans[3]], mode=mode, max_failures=2)
    assert [r.state for r in results] == [
        State.NEW_TRACK, State.TRACKING, State.FAILED, State.LOST, State.LOST, State.TRACKING]
    assert [r.failures for r in results] == [0, 0, 1, 2, 3, 0]
    for lost in results[2:5]:
        assert not lost.success
        assert lost.T_odom_sensor is lost.covariance is lost.twist is None
        assert not lost.keyframe
    assert any('without a pose: lost' in w for w in results[3].warnings)
    back = results[5]
    assert back.track_id == 1
    assert not back.restarted
    assert_near(back.T_odom_sensor, relative(street[0][2], street[3][2]))
    assert back.twist is None    # the mean of such a journey is no velocity


@pytest.mark.parametrize('mode', MODES)
def test_lost_for_long_a_new_track_begins_and_the_old_one_can_come_back(scans, street, others,
                                                                       elsewhere, mode):
    """A track elsewhere has a number and an origin of its own; back, the first goes on."""
    results = track([*scans[:2], *others, scans[2], scans[3]], period_ns=2 * PERIOD_NS, mode=mode,
                    max_failures=2, new_track_after=0.3)
    assert [r.state for r in results] == [
        State.NEW_TRACK, State.TRACKING, State.FAILED, State.NEW_TRACK, State.TRACKING,
        State.TRACKING, State.TRACKING]
    assert [r.track_id for r in results] == [1, 1, 1, 2, 2, 1, 1]
    assert [r.restarted for r in results] == [True, False, False, True, False, False, False]
    begun = results[3]
    np.testing.assert_array_equal(begun.T_odom_sensor, np.eye(4))
    assert any('lost for 0.4 s: a new track begins' in w for w in begun.warnings)
    assert_near(results[4].T_odom_sensor, relative(elsewhere[1][2], elsewhere[2][2]))
    assert any('track 1 is found again' in w for w in results[5].warnings)
    for result, i in ((results[5], 2), (results[6], 3)):
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))


def test_a_new_track_finds_back_at_its_next_keyframe(scans, street, garbage):
    """Blinded, it begins anew twice; each keyframe tries an older one, and joins its track."""
    tracker = Tracker(tracker_config=TrackerConfig(max_failures=1, new_track_after=0.0,
                                                   retries=0, keyframe_distance=1.0))
    results = track([scans[0], garbage, scans[1], scans[2], scans[3]], tracker)
    assert [r.track_id for r in results] == [1, 2, 3, 3, 1]
    assert results[4].state is State.TRACKING
    assert_near(results[4].T_odom_sensor, relative(street[0][2], street[3][2]))


def test_failures_are_counted_in_a_row(scans, garbage):
    """A success in between starts the count again."""
    results = track([scans[0], garbage, scans[1], garbage, scans[2]], max_failures=2)
    assert [r.success for r in results] == [True, False, True, False, True]
    assert not any(r.restarted for r in results[1:])


@pytest.mark.parametrize('points', [1, 10])
@pytest.mark.parametrize('mode', MODES)
def test_a_useless_scan_does_not_become_the_reference(scans, street, points, mode):
    """A handful of points, however often and long: no track begins with them."""
    few = SemanticScan(scans[0].points[:points], scans[0].labels[:points])
    results = track([scans[0], *[few] * 4, scans[1]], max_failures=2, new_track_after=0.1,
                    mode=mode)
    assert [r.success for r in results] == [True] + [False] * 4 + [True]
    assert not any(r.restarted or r.keyframe for r in results[1:5])
    assert results[5].reference_stamp_ns == 0
    assert_near(results[5].T_odom_sensor, relative(street[0][2], street[1][2]))


def test_a_useless_first_scan_is_not_the_origin(scans, street):
    """The track begins at the first scan that something can be registered to."""
    results = track([SemanticScan([[5, 0, 0]], [50]), scans[0], scans[1]])
    assert [r.success for r in results] == [False, True, True]
    assert 'keypoints to start from' in results[0].reason
    assert results[0].T_odom_sensor is None
    assert not results[0].keyframe
    np.testing.assert_array_equal(results[1].T_odom_sensor, np.eye(4))
    assert_near(results[2].T_odom_sensor, relative(street[0][2], street[1][2]))


def test_a_late_scan_is_dropped_and_counted(scans, street):
    """Swapped, twice, or without a stamp: said, and the track goes on as if nothing had been."""
    stamps = [10**9, 2 * 10**9, 2 * 10**9 - PERIOD_NS, 0, 2 * 10**9, 3 * 10**9]
    results = track([scans[0], scans[1], scans[3], scans[3], scans[1], scans[2]], stamps=stamps)
    assert [r.state for r in results] == [State.NEW_TRACK, State.TRACKING, *[State.LATE] * 3,
                                          State.TRACKING]
    assert [r.late for r in results] == [0, 0, 1, 2, 3, 3]
    assert 'stamp 1.900 s is not after the last, 2.000 s' in results[2].reason
    for late in results[2:5]:
        assert not late.success
        assert late.T_odom_sensor is late.covariance is late.twist is late.registration is None
    last = results[5]
    assert last.track_id == 1
    assert_near(last.T_odom_sensor, relative(street[0][2], street[2][2]))
    assert_near(se3.exp(last.twist), relative(street[1][2], street[2][2]), 0.03)


def test_a_bag_that_starts_over_begins_a_new_track(scans, street):
    """The second scan behind confirms it: identity again, and a warning that says by how much."""
    results = track([*scans[:2], *scans[1:]], stamps=[
        5 * 10**9, 5 * 10**9 + PERIOD_NS, 10**9, 10**9 + PERIOD_NS, 10**9 + 2 * PERIOD_NS])
    assert [r.state for r in results] == [State.NEW_TRACK, State.TRACKING, State.LATE,
                                          State.NEW_TRACK, State.TRACKING]
    assert any('time ran backwards by 4.000 s' in w for w in results[3].warnings)
    assert [r.track_id for r in results] == [1, 1, 1, 2, 2]
    assert results[3].restarted
    np.testing.assert_array_equal(results[3].T_odom_sensor, np.eye(4))
    assert_near(results[4].T_odom_sensor, relative(street[2][2], street[3][2]))


def test_reset_forgets_everything(scans):
    tracker = Tracker()
    track(scans[:2], tracker)
    tracker.reset()
    result = tracker.track(scans[2], 0)
    assert result.restarted
    assert result.track_id == 2
    assert result.warnings == ()
    np.testing.assert_array_equal(result.T_odom_sensor, np.eye(4))


@pytest.mark.parametrize('yaw', [0.0, 0.3])
def test_twist_is_motion_over_time_in_the_sensor_frame(scans, street, yaw):
    """1.5 m and a turn in 0.1 s: the velocity that, held for so long, leads there."""
    second, turn = spun(scans[1], yaw)
    T = relative(street[0][2], street[1][2]) @ turn
    for seconds in (0.1, 0.2):
        result = track([scans[0], second], stamps=[0, round(seconds * 1e9)])[1]
        assert_near(se3.exp(result.twist * seconds), T, 0.03, 0.2)
        sigma = np.sqrt(np.diag(result.twist_covariance)) * seconds
        assert (sigma[:3] < 0.03).all()
        assert (sigma > 1e-4).all()
        assert np.linalg.norm(result.twist[:3]) == pytest.approx(1.5 / seconds, rel=0.05)


@pytest.mark.parametrize('mode', MODES)
def test_twist_is_of_the_last_motion_and_not_since_the_keyframe(scans, mode):
    """Two moves at 15 m/s, then standing for long: 15, 15, and at once nothing."""
    results = track([*scans[:3], scans[2], scans[2]], mode=mode, keyframe_distance=100.0,
                    stamps=[0, PERIOD_NS, 2 * PERIOD_NS, 3 * PERIOD_NS, 10**10])
    speeds = [np.linalg.norm(r.twist[:3]) for r in results[1:]]
    np.testing.assert_allclose(speeds, [15.0, 15.0, 0.0, 0.0], atol=0.3)


def test_covariance_is_that_of_the_keyframe_and_one_step(scans):
    """In keyframe mode doubt does not grow between keyframes as it does scan by scan."""
    consecutive = track(scans, mode='consecutive')[-1].covariance
    result = track(scans, **FAR)[-1]
    np.testing.assert_allclose(result.covariance, result.registration.covariance, rtol=1e-9)
    np.testing.assert_array_equal(result.reference_covariance, result.registration.covariance)
    np.testing.assert_array_equal(result.T_reference_sensor, result.registration.T_target_source)
    assert np.trace(result.covariance[:3, :3]) < np.trace(consecutive[:3, :3])


@pytest.mark.parametrize('mode', MODES)
def test_the_same_scan_twice_has_a_covariance_that_can_be_inverted(scans, mode):
    """No noise between them, but a pose graph takes the inverse."""
    result = track([scans[0], scans[0]], mode=mode)[1]
    assert_near(result.T_odom_sensor, np.eye(4), 0.001, 0.001)
    np.linalg.cholesky(result.reference_covariance)


def test_a_motion_that_cannot_be_is_refused(scans):
    """1.5 m in 0.1 s with at most 10 m/s: no pose; after 0.3 s it may have gone there."""
    results = track(scans[:3], stamps=[0, PERIOD_NS, 4 * PERIOD_NS], max_speed=10.0)
    assert [r.state for r in results] == [State.NEW_TRACK, State.FAILED, State.TRACKING]
    assert 'm/s is over max_speed 10.0' in results[1].reason


def test_without_local_refinement_there_is_no_covariance(scans):
    results = track(scans[:2], Tracker(SgorConfig(local_refinement=False)))
    assert results[1].success
    assert results[1].covariance is results[1].twist_covariance is None
    assert results[1].twist is not None


def test_settings_change_between_scans_without_losing_the_track(scans, street):
    """Taken at the next scan; the reference is prepared again with the new ones."""
    tracker = Tracker(tracker_config=TrackerConfig(predict_first=False))
    first = track(scans[:2], tracker)[1]
    tracker.config = tracker.config.replace(voxel_size=0.7, quick_keypoints=300)
    second = tracker.track(scans[2], 2 * PERIOD_NS)
    assert second.success
    assert not second.restarted
    assert second.reference_stamp_ns == 0
    assert len(second.registration.source_points) <= 300 < len(first.registration.source_points)
    assert_near(second.T_odom_sensor, relative(street[0][2], street[2][2]))
    tracker.config = tracker.config.replace(min_confidence=1.0, max_correspondences=300)
    refused = tracker.track(scans[3], 3 * PERIOD_NS)
    assert 'min_confidence 1.00' in refused.reason
    tracker.config = SgorConfig()
    tracker.tracker_config = TrackerConfig(mode='consecutive')
    last = tracker.track(scans[3], 4 * PERIOD_NS)
    assert last.keyframe
    assert_near(last.T_odom_sensor, relative(street[0][2], street[3][2]))


@pytest.mark.parametrize('mode', MODES)
def test_a_prediction_is_tested_once_there_is_one_and_makes_no_keyframe(scans, street, mode):
    """SGOR finds the first motion and each keyframe that is remembered; the clouds the rest."""
    results = track(scans, mode=mode, keyframe_distance=4.0)
    assert [r.confirmed for r in results] == [False, False, True, False]
    assert results[2].registration.solution is None
    assert len(results[3].registration.solution.hypotheses) > 0
    assert 'matching' not in results[2].timings
    results = track(scans, mode=mode, predict_first=False)
    assert not any(r.confirmed for r in results)
    for i, result in enumerate(results):
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))


@pytest.mark.parametrize('mode', MODES)
def test_what_is_not_as_predicted_is_found_by_sgor(scans, street, others, mode):
    """A stop from 15 m/s, and another place: the prediction is not clung to."""
    results = track([*scans[:3], scans[2], others[0], scans[3]], mode=mode, **FAR)
    assert [r.confirmed for r in results] == [False, False, True, False, False, False]
    assert [r.success for r in results] == [True, True, True, True, False, True]
    for result, i in ((results[3], 2), (results[5], 3)):
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('out', [(1, 3), (2, 3), (0,)])
def test_dropouts_of_the_segmentation_leave_no_mark(scans, street, mode, out):
    """Scans whose labels are all zero, at the beginning too: no scan lost and no jump."""
    dropped = [SemanticScan(scan.points, np.zeros(len(scan), int)) if i in out else scan
               for i, scan in enumerate(scans)]
    for i, result in enumerate(track(dropped, mode=mode)):
        assert result.success, result.reason
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))


def test_a_threshold_prepares_no_keyframe_again(scans, monkeypatch):
    """What a scan was not prepared with may change at every scan."""
    tracker = Tracker()
    track(scans[:2], tracker)
    again = []
    monkeypatch.setattr(keyframes_module, 'preprocess', lambda *_, **__: again.append(1))
    tracker.config = tracker.config.replace(min_confidence=0.86, hypothesis_radius=25.0)
    assert tracker.track(scans[2], 2 * PERIOD_NS).success
    assert not again


def test_keyframes_have_ids_of_their_own(scans):
    """Also where time goes back and stamps come twice."""
    tracker = Tracker(tracker_config=TrackerConfig(mode='consecutive'))
    first = track(scans[:3], tracker, stamps=[10 * PERIOD_NS, 11 * PERIOD_NS, 12 * PERIOD_NS])
    assert [r.keyframe_id for r in first] == [1, 2, 3]
    assert [r.reference_id for r in first] == [None, 1, 2]
    tracker.reset()
    again = track(scans[:3], tracker, stamps=[10 * PERIOD_NS, 11 * PERIOD_NS, 12 * PERIOD_NS])
    assert [r.keyframe_id for r in again] == [4, 5, 6]
    assert [r.reference_id for r in again] == [None, 4, 5]
    few = track(scans[:3], mode='keyframe', keyframe_distance=50.0)
    assert [r.keyframe_id for r in few] == [1, None, None]
    assert [r.reference_id for r in few] == [None, 1, 1]


def test_a_prediction_needs_competing_hypotheses_and_says_so(scans):
    results = track(scans[:4], Tracker(SgorConfig(hypothesis_radius=0.0)))
    assert not any(r.confirmed for r in results)
    assert any('hypothesis_radius is 0' in text for text in results[0].warnings)
    assert not any('hypothesis_radius' in text for r in results[1:] for text in r.warnings)
    assert not track(scans[:1])[0].warnings


def test_a_prediction_is_believed_from_a_confidence_of_its_own(scans):
    """Whoever accepts any answer of SGOR still hears of other ones."""
    believed = track(scans, Tracker(SgorConfig(min_confidence=0.0)))
    assert any(r.confirmed for r in believed)
    never = track(scans, Tracker(SgorConfig(min_confidence=0.0), TrackerConfig(
        min_prediction_confidence=1.0)))
    assert not any(r.confirmed for r in never)
    assert all(r.success for r in never)
