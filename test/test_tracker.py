"""From pairs to a track: what is registered to what, gaps, restarts, covariance and twist."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.evaluation.pairs import read_drives

PERIOD_NS = 100_000_000
MODES = ('consecutive', 'keyframe')
FAR = {'keyframe_distance': 100.0, 'keyframe_angle': 3.0, 'keyframe_inliers': 0.0}


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


def track(scans, tracker=None, stamps=None, **settings):
    """Return what becomes of scans 0.1 s apart."""
    tracker = tracker or Tracker(tracker_config=TrackerConfig(**settings))
    stamps = stamps or [i * PERIOD_NS for i in range(len(scans))]
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
    drive = next(d for d in read_drives(data_folder / 'kitti') if d.name.endswith('08'))
    results = track([frame.read() for frame in drive.frames[:10]], mode=mode)
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


def test_a_keyframe_by_falling_inliers(scans):
    """The share is that of the first scan after the keyframe; it falls on the way."""
    results = track(scans, **FAR)
    counts = [r.registration.inliers.sum() for r in results[1:]]
    assert counts[0] > counts[1] > counts[2]
    between = float((counts[1] + counts[2]) / 2 / counts[0])
    assert [r.keyframe for r in track(scans, **{**FAR, 'keyframe_inliers': between})] == [
        True, False, False, True]
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
def test_after_many_failures_the_track_goes_on_from_the_last_pose(scans, others, elsewhere, mode):
    """Carried away to another street: said, and from there on steps are added to the last pose."""
    results = track([*scans[:3], *others], mode=mode, max_failures=2)
    assert [r.success for r in results] == [True, True, True, False, False, True]
    assert [r.restarted for r in results] == [True, False, False, False, True, False]
    lost = results[4]
    assert lost.T_odom_sensor is None
    assert lost.keyframe
    assert any('2 registrations in a row failed' in w for w in lost.warnings)
    again = results[5]
    assert again.reference_stamp_ns == lost.stamp_ns
    assert_near(again.T_odom_sensor, results[2].T_odom_sensor @ relative(elsewhere[1][2],
                                                                         elsewhere[2][2]))
    assert again.covariance is None    # nobody knows how far the last pose was off


def test_failures_are_counted_in_a_row(scans, garbage):
    """A success in between starts the count again."""
    results = track([scans[0], garbage, scans[1], garbage, scans[2]], max_failures=2)
    assert [r.success for r in results] == [True, False, True, False, True]
    assert not any(r.restarted for r in results[1:])


def test_a_useless_scan_does_not_become_the_reference(scans, street):
    """One point, however often: the reference stays, and nothing claims a restart."""
    point = SemanticScan([[5, 0, 0]], [50])
    results = track([scans[0], *[point] * 4, scans[1]], max_failures=2)
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


def test_time_that_runs_backwards_starts_anew(scans, street):
    """A bag that starts over: identity again, and a warning that says by how much."""
    results = track(scans[:4], stamps=[5 * 10**9, 5 * 10**9 + PERIOD_NS, 10**9, 10**9 + PERIOD_NS])
    assert any('time ran backwards by 4.100 s' in w for w in results[2].warnings)
    assert results[2].restarted
    np.testing.assert_array_equal(results[2].T_odom_sensor, np.eye(4))
    assert_near(results[3].T_odom_sensor, relative(street[2][2], street[3][2]))


@pytest.mark.parametrize('mode', MODES)
def test_the_same_scan_and_stamp_twice(scans, street, mode):
    """It stays where it is, has no twist, and the next is right."""
    results = track([scans[0], scans[1], scans[1], scans[2]], mode=mode,
                    stamps=[0, PERIOD_NS, PERIOD_NS, 2 * PERIOD_NS])
    assert all(r.success for r in results)
    assert_near(results[2].T_odom_sensor, results[1].T_odom_sensor, 0.01, 0.02)
    if mode == 'consecutive':
        assert results[2].twist is None
    assert_near(results[3].T_odom_sensor, relative(street[0][2], street[2][2]))


def test_reset_forgets_everything(scans):
    tracker = Tracker()
    track(scans[:2], tracker)
    tracker.reset()
    result = tracker.track(scans[2], 0)
    assert result.restarted
    assert result.warnings == ()
    np.testing.assert_array_equal(result.T_odom_sensor, np.eye(4))


@pytest.mark.parametrize('yaw', [0.0, 0.3])
def test_twist_is_motion_over_time_in_the_sensor_frame(scans, street, yaw):
    """1.5 m and a turn in 0.1 s: 15 m/s, seen from the turned sensor; half that in twice the time.
    """
    second, turn = spun(scans[1], yaw)
    T = relative(street[0][2], street[1][2]) @ turn
    velocity = T[:3, :3].T @ T[:3, 3]
    rate = Rotation.from_matrix(T[:3, :3]).as_rotvec()
    for seconds in (0.1, 0.2):
        twist = track([scans[0], second], stamps=[0, round(seconds * 1e9)])[1].twist
        np.testing.assert_allclose(twist[:3] * seconds, velocity, atol=0.03)
        np.testing.assert_allclose(twist[3:] * seconds, rate, atol=0.005)
    assert np.linalg.norm(velocity) == pytest.approx(1.5, abs=0.1)


def sampled(mean, covariance, rng, count):
    """Return (count, 4, 4) poses perturbed from the left, translation of the origin apart."""
    noise = rng.multivariate_normal(np.zeros(6), covariance, count)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(noise[:, 3:]).as_matrix() @ mean[:3, :3]
    T[:, :3, 3] = mean[:3, 3] + noise[:, :3]
    return T


def spread(T, mean):
    """Return the (6, 6) covariance of poses around their mean."""
    turn = Rotation.from_matrix(T[:, :3, :3] @ mean[:3, :3].T).as_rotvec()
    return np.cov(np.hstack((T[:, :3, 3] - mean[:3, 3], turn)).T)


def test_covariance_is_that_of_composed_noise(others):
    """Steps of 6 m with turns, each with the noise it reports: Monte Carlo finds the same.

    Compared where the sum is a unit matrix, so that a wrong lever or frame shows.
    """
    turned = [spun(scan, yaw)[0] for scan, yaw in zip(others, (0.0, 1.2, -0.8), strict=True)]
    results = track(turned, mode='consecutive')
    assert all(r.success for r in results)
    rng, count = np.random.default_rng(0), 40000
    T = np.tile(np.eye(4), (count, 1, 1))
    before = 0.0
    for result in results[1:]:
        step = result.registration
        # larger noise would bend: 1 in 100 of it, as variances are linear
        T = T @ sampled(step.T_target_source, step.covariance * 1e-2, rng, count)
        whiten = np.linalg.inv(np.linalg.cholesky(result.covariance))
        found = whiten @ spread(T, result.T_odom_sensor) @ whiten.T * 1e2
        np.testing.assert_allclose(found, np.eye(6), atol=0.04)
        assert np.trace(result.covariance[:3, :3]) > before
        before = np.trace(result.covariance[:3, :3])


def test_covariance_is_that_of_the_keyframe_and_one_step(scans):
    """In keyframe mode doubt does not grow between keyframes as it does scan by scan."""
    consecutive = track(scans, mode='consecutive')[-1].covariance
    result = track(scans, **FAR)[-1]
    np.testing.assert_allclose(result.covariance, result.registration.covariance, rtol=1e-9)
    assert np.trace(result.covariance[:3, :3]) < np.trace(consecutive[:3, :3])


def test_without_local_refinement_there_is_no_covariance(scans):
    results = track(scans[:2], Tracker(SgorConfig(local_refinement=False)))
    assert results[1].success
    assert results[1].covariance is None


def test_settings_change_between_scans_without_losing_the_track(scans, street):
    """Taken at the next scan; the reference is prepared again with the new ones."""
    tracker = Tracker()
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
@pytest.mark.parametrize('out', [(1, 3), (2, 3), (0,)])
def test_dropouts_of_the_segmentation_leave_no_mark(scans, street, mode, out):
    """Scans whose labels are all zero, at the beginning too: no scan lost and no jump."""
    dropped = [SemanticScan(scan.points, np.zeros(len(scan), int)) if i in out else scan
               for i, scan in enumerate(scans)]
    for i, result in enumerate(track(dropped, mode=mode)):
        assert result.success, result.reason
        assert_near(result.T_odom_sensor, relative(street[0][2], street[i][2]))
