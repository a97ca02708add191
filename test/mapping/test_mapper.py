"""The mapper on a street that is driven down and, in the other lane, back."""
from dataclasses import fields
import multiprocessing
import subprocess
import sys

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from return_drive import return_drive
from return_drive import THERE
from return_drive import TURN

from sgor_ros import InputError
from sgor_ros import Loop
from sgor_ros import Mapper
from sgor_ros import MapperConfig
from sgor_ros import SemanticScan
from sgor_ros import State
from sgor_ros import TrackedScan
from sgor_ros import Tracker
from sgor_ros import TrackerConfig
from sgor_ros.core.common import se3
from sgor_ros.mapping.edge import Kind
from sgor_ros.pipeline.loop_process import end
from sgor_ros.pipeline.loop_process import loop_process

pytest.importorskip('gtsam')

PERIOD_NS = 100_000_000


@pytest.fixture(scope='module')
def drive():
    """Return scans with their true poses."""
    return [(SemanticScan(points, labels), T) for points, labels, T in return_drive()]


def mapped(mapper, drive, start=0):
    return [mapper.track(scan, (start + i) * PERIOD_NS) for i, (scan, _) in enumerate(drive)]


@pytest.fixture(scope='module')
def there_again(drive):
    """Return a mapper that has seen the drive, and what it said of each scan."""
    mapper = Mapper()
    return mapper, mapped(mapper, drive)


def truth_of(drive, stamp_ns):
    return drive[stamp_ns // PERIOD_NS][1]


def worst(trajectory, drive):
    """Return the largest error of a trajectory, metres."""
    first = drive[0][1]
    return max(errors(T, relative(first, truth_of(drive, stamp)))[0]
               for stamp, T in zip(*trajectory, strict=True))


def test_the_way_back_closes_loops_and_no_wrong_ones(drive, there_again):
    mapper, tracked = there_again
    loops = [loop for scan in tracked for loop in scan.loops]
    back = [scan.stamp_ns for scan in tracked[THERE + TURN + 6:] if scan.keyframe]
    closed = {loop.source_stamp_ns for loop in loops}
    assert len(back) >= 3
    assert set(back) <= closed
    for loop in loops:
        true = relative(truth_of(drive, loop.target_stamp_ns),
                        truth_of(drive, loop.source_stamp_ns))
        metres, degrees = errors(loop.T_target_source, true)
        assert metres < 0.1
        assert degrees < 0.5
        d = se3.perturbation(loop.T_target_source, true)
        assert d @ np.linalg.solve(loop.covariance, d) < 20.06
    assert len(mapper.graph.loops) == len(loops)
    assert {edge.kind for edge in mapper.graph.edges} == {Kind.ODOMETRY, Kind.LOOP}


def test_the_trajectory_has_every_scan_where_it_was(drive, there_again):
    mapper, tracked = there_again
    stamps_ns, T_map_sensor = mapper.trajectory()
    assert stamps_ns.dtype == np.int64
    np.testing.assert_array_equal(stamps_ns, [scan.stamp_ns for scan in tracked])
    assert T_map_sensor.shape == (len(drive), 4, 4)
    assert worst(mapper.trajectory(), drive) < 0.1
    assert len(set(mapper.trajectory().part)) == 1
    last = tracked[-1]
    np.testing.assert_allclose(last.T_map_odom @ last.T_odom_sensor, T_map_sensor[-1], atol=1e-9)


def test_a_mapped_scan_is_what_the_tracker_says(drive, there_again):
    tracker = Tracker()
    for i, (scan, _) in enumerate(drive[:3]):
        plain, tracked = tracker.track(scan, i * PERIOD_NS), there_again[1][i]
        assert isinstance(tracked, TrackedScan)
        for item in fields(TrackedScan):
            if item.name not in ('registration', 'timings'):
                np.testing.assert_array_equal(getattr(tracked, item.name),
                                              getattr(plain, item.name))


def test_space_that_is_covered_costs_no_memory(there_again):
    """The way back adds keyframes only where the way there has none."""
    mapper, tracked = there_again
    nodes = sum(scan.keyframe for scan in tracked)
    assert len(mapper.graph) == nodes
    there = sum(scan.keyframe for scan in tracked[:THERE])
    assert len(mapper.keyframes) <= there + 1 < nodes - 3


def test_a_narrow_view_covers_only_what_it_sees(drive):
    """Of a sensor that looks ahead the way back is another view, and closes loops later."""
    def ahead(scan):
        seen = np.abs(np.arctan2(scan.points[:, 1], scan.points[:, 0])) < np.radians(60)
        return SemanticScan(scan.points[seen], scan.labels[seen])

    narrow = [(ahead(scan), T) for scan, T in drive]
    mapper = Mapper()
    tracked = mapped(mapper, narrow)
    back = [i for i, scan in enumerate(tracked[THERE + TURN:], THERE + TURN) if scan.keyframe]
    kept = {one.stamp_ns for one in mapper.keyframes}
    assert len(back) >= 3
    assert len([i for i in back if tracked[i].stamp_ns in kept]) >= len(back) - 1
    again = mapped(mapper, narrow[THERE + TURN:], len(drive))
    loops = [loop for scan in again for loop in scan.loops]
    assert len(loops) >= 2
    truth = [T for _, T in [*narrow, *narrow[THERE + TURN:]]]
    for loop in loops:
        metres, degrees = errors(loop.T_target_source, relative(
            truth[loop.target_stamp_ns // PERIOD_NS], truth[loop.source_stamp_ns // PERIOD_NS]))
        assert metres < 0.2
        assert degrees < 1.0


def test_ten_false_loops_move_nothing(drive, there_again):
    mapper, tracked = there_again
    before = mapper.trajectory().T_map_sensor
    keys = [scan.stamp_ns for scan in tracked if scan.keyframe]
    rng = np.random.default_rng(0)
    for _ in range(10):
        target, source = sorted(rng.choice(keys, 2, replace=False).tolist())
        T = se3.compose(se3.rotations(np.array([0, 0, rng.uniform(-3, 3)])),
                        np.array([*rng.uniform(-15, 15, 2), 0]))
        assert mapper.offer(Loop(source, target, T, 1e-4 * np.eye(6))) == ()
    after = mapper.trajectory().T_map_sensor
    assert np.linalg.norm(after[:, :3, 3] - before[:, :3, 3], axis=1).max() < 0.05


def test_a_right_loop_from_elsewhere_is_taken(drive, there_again):
    mapper, tracked = there_again
    keys = [scan.stamp_ns for scan in tracked if scan.keyframe]
    true = relative(truth_of(drive, keys[1]), truth_of(drive, keys[-1]))
    loop, = mapper.offer(Loop(keys[-1], keys[1], true, 1e-2 * np.eye(6)))
    assert (loop.source_stamp_ns, loop.target_stamp_ns) == (keys[-1], keys[1])
    assert worst(mapper.trajectory(), drive) < 0.1
    with pytest.raises(InputError, match='stamp_ns = 17'):
        mapper.offer(Loop(keys[-1], 17, true, np.eye(6)))


def test_a_kidnapped_sensor_finds_itself_within_two_scans(drive):
    """Carried back by 40 m and turned: the second scan has the right pose in the map."""
    mapper = Mapper()
    mapped(mapper, drive[:THERE])
    carried = drive[-3:]
    first, second, third = mapped(mapper, carried, THERE)
    assert first.state is State.FAILED
    assert 'another place of the map' in first.warnings[-1]
    assert second.restarted
    assert len(second.loops) >= 2
    for scan, (_, T) in ((second, carried[1]), (third, carried[2])):
        found = scan.T_map_odom @ scan.T_odom_sensor
        metres, degrees = errors(found, relative(drive[0][1], T))
        assert metres < 0.2
        assert degrees < 1
    assert len(set(mapper.trajectory().part)) == 1


def test_a_place_that_nobody_has_seen_stays_apart(drive, elsewhere):
    mapper = Mapper()
    mapped(mapper, drive[:6])
    mapper.tracker.begin_track()
    scan, = mapped(mapper, [(SemanticScan(*elsewhere[0][:2]), None)], 6)
    assert scan.track_id == 2
    assert scan.loops == ()
    assert len(set(mapper.trajectory().part)) == 2


def test_without_registrations_it_is_odometry(drive):
    mapper = Mapper(mapper_config=MapperConfig(registrations_per_scan=0))
    tracked = mapped(mapper, drive[:8])
    assert not len(mapper.keyframes)
    np.testing.assert_allclose(mapper.trajectory().T_map_sensor,
                               [scan.T_odom_sensor for scan in tracked], atol=1e-9)


def test_in_consecutive_mode_few_scans_become_nodes(drive):
    mapper = Mapper(tracker_config=TrackerConfig(mode='consecutive'))
    tracked = mapped(mapper, drive[:12])
    assert all(scan.keyframe for scan in tracked)
    # 22 m by more than 5 m each
    assert 4 <= len(mapper.graph) <= 5
    assert worst(mapper.trajectory(), drive) < 0.1


def test_a_configuration_of_another_kind_is_refused():
    with pytest.raises(InputError, match='config: expected MapperConfig'):
        Mapper(mapper_config={'loop_radius': 20.0})


def test_pairs_may_be_registered_in_another_process(drive):
    executor = loop_process()
    try:
        mapper = Mapper(executor=executor)
        loops = [loop for scan in mapped(mapper, drive) for loop in scan.loops]
        loops += mapper.finish()
    finally:
        end(executor)
    assert len(mapper.candidates) == 0
    assert len(loops) == len(mapper.graph.loops) > 5
    assert worst(mapper.trajectory(), drive) < 0.1


def test_where_the_other_process_dies_odometry_goes_on(drive):
    executor = loop_process()
    try:
        mapper = Mapper(executor=executor)
        mapped(mapper, drive[:-6])
        process, = multiprocessing.active_children()
        process.kill()
        process.join()
        tracked = mapped(mapper, drive[-6:], len(drive) - 6)
    finally:
        end(executor)
    assert all(scan.success for scan in tracked)
    told = [text for scan in tracked for text in scan.warnings if 'not closed any more' in text]
    assert len(told) == 1


WITHOUT = """
import sys
sys.modules['gtsam'] = None
import numpy as np
from sgor_ros import Mapper, SemanticScan
from sgor_ros.world import Lidar, simulate
mapper = Mapper()
scans = [mapper.track(SemanticScan(points, labels), round(1e9 * seconds)) for
         seconds, points, labels, _ in simulate(3, lidar=Lidar(beams=32, columns=600))]
for scan in scans:
    print(scan.success, len(scan.loops), [text for text in scan.warnings if 'GTSAM' in text])
print(mapper.trajectory().T_map_sensor[:, 0, 3].round(1).tolist())
"""


def test_without_gtsam_it_says_so_once_and_goes_on_as_odometry():
    done = subprocess.run([sys.executable, '-c', WITHOUT], capture_output=True, text=True,
                          check=True)
    first, second, third, poses = done.stdout.splitlines()
    assert 'GTSAM is not installed' in first
    assert "pip install 'sgor_ros[mapping]'" in first
    assert first.startswith('True 0')
    assert second == third == 'True 0 []'
    assert poses == '[0.0, 0.6, 1.2]'
