"""The pipeline of node and replay: whatever a cloud brings about, its scan fails alone."""
from errno import ENOSPC
from functools import partial
import os

from conftest import errors
from conftest import PERIOD_NS
from conftest import relative
import numpy as np
import pytest

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.io.bags import BagWriter
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.messages import matrix_of
from sgor_ros.io.messages import matrix_of_transform
from sgor_ros.io.sequence import StampedScan
from sgor_ros.io.stream_config import StreamConfig
from sgor_ros.pipeline import extrinsic
from sgor_ros.pipeline.pipeline import Pipeline
from sgor_ros.tracker import State

T_BASE_SENSOR = parse_transform('1.2 -0.3 1.8 0.05 0.1 1.5', 'mount')


class Memory:
    """A sink that keeps messages of rosbags in lists, and can lose a type."""

    def __init__(self, tmp_path, *unwanted):
        self._types = BagWriter(tmp_path / 'never written').types
        self._unwanted = unwanted
        self.without = ''
        self.heard = []

    def types(self, name):
        if name == self.without:
            raise KeyError(name)
        return self._types(name)

    def wants(self, topic):
        return topic not in self._unwanted

    def write(self, topic, message, arrived_ns):
        self.heard.append((topic, message, arrived_ns))

    def of(self, topic):
        return [message for name, message, _ in self.heard if name == topic]


def stamped(street, index, frame='lidar', stamp_ns=None, read=None):
    points, labels, _ = street[index]
    stamp_ns = index * PERIOD_NS if stamp_ns is None else stamp_ns
    return StampedScan(stamp_ns, frame, read or partial(SemanticScan, points, labels),
                       stamp_ns + 5)


def assert_goes_on(pipeline, street, first=0, index=2):
    """Assert that the pipeline finds where a later scan is in the track of the first."""
    outcome = pipeline.process(stamped(street, index))
    assert (outcome.tracked.track_id, outcome.reason) == (1, '')
    metres, degrees = errors(outcome.tracked.T_odom_sensor,
                             relative(street[first][2], street[index][2]))
    assert metres < 0.15
    assert degrees < 0.3


def fault():
    raise ZeroDivisionError('by a cloud')


def test_a_fault_while_a_cloud_is_decoded(street, tmp_path):
    sink = Memory(tmp_path)
    pipeline = Pipeline(Tracker(), StreamConfig(), sink)
    pipeline.process(stamped(street, 0))
    before = len(sink.heard)
    outcome = pipeline.process(stamped(street, 1, read=fault))
    assert outcome.reason == 'fault of the program: ZeroDivisionError: by a cloud'
    assert outcome.tracked is outcome.T_odom_child is None
    assert (outcome.row().stamp_ns, outcome.row().reason) == (PERIOD_NS, outcome.reason)
    assert len(sink.heard) == before
    assert_goes_on(pipeline, street)


def test_a_fault_while_a_message_is_made(street, tmp_path):
    """None of the messages of that scan goes out, not even those that were made before."""
    sink = Memory(tmp_path)
    pipeline = Pipeline(Tracker(), StreamConfig(), sink)
    pipeline.process(stamped(street, 0))
    before = len(sink.heard)
    sink.without = 'visualization_msgs/msg/Marker'
    outcome = pipeline.process(stamped(street, 1))
    assert outcome.reason.startswith('fault of the program: KeyError')
    assert len(sink.heard) == before
    sink.without = ''
    assert_goes_on(pipeline, street)
    assert len(sink.of('odometry')) == 2


def test_a_fault_while_a_scan_is_placed(street, tmp_path):
    faults = [False, True, False]
    pipeline = Pipeline(Tracker(), StreamConfig(base_frame='base'), Memory(tmp_path),
                        lambda *_: fault() if faults.pop(0) else T_BASE_SENSOR)
    assert pipeline.process(stamped(street, 0)).reason == ''
    assert pipeline.process(stamped(street, 1)).reason.startswith('fault of the program: Zero')
    assert_goes_on(pipeline, street)


def test_what_a_sink_raises_is_no_fault_of_the_cloud(street, tmp_path):
    """A full disk ends a replay; it is not told as a scan that failed."""
    class Full(Memory):
        def write(self, topic, message, arrived_ns):
            raise OSError(ENOSPC, os.strerror(ENOSPC))

    pipeline = Pipeline(Tracker(), StreamConfig(), Full(tmp_path))
    with pytest.raises(OSError, match='No space left'):
        pipeline.process(stamped(street, 0))


def test_an_extrinsic_that_is_not_known_holds_back_what_needs_it(street, tmp_path):
    """The pose of the base is not published; the step between sensors is."""
    sink, known = Memory(tmp_path), [True, False, True]
    pipeline = Pipeline(Tracker(), StreamConfig(base_frame='base'), sink, lambda stamp, frame: (
        T_BASE_SENSOR if known.pop(0) else f'nothing from {frame} at {stamp}'))
    outcomes = [pipeline.process(stamped(street, index)) for index in range(3)]
    assert [outcome.reason for outcome in outcomes] == [
        '', f'nothing from lidar at {PERIOD_NS}', '']
    assert outcomes[1].tracked.success
    assert outcomes[1].T_odom_child is None
    assert [len(sink.of(topic)) for topic in (
        'odometry', 'pose', '/tf', 'correspondences', 'relative_pose')] == [2, 2, 2, 2, 2]
    truth = relative(street[0][2] @ np.linalg.inv(T_BASE_SENSOR),
                     street[2][2] @ np.linalg.inv(T_BASE_SENSOR))
    assert errors(outcomes[2].T_odom_child, truth)[0] < 0.15


@pytest.mark.parametrize('frame', ['lidar', 'base'])
def test_the_mount_tells_what_is_up_and_where_the_sensor_is(street, frame):
    """Clouds of a sensor that hangs upside down, in its own frame and in that of the base."""
    config = StreamConfig(base_frame='base', T_base_sensor='1.2 -0.3 2.0 3.0 0.1 1.5')
    mount = parse_transform(config.T_base_sensor, 'mount')
    T_frame_street = np.linalg.inv(mount) if frame == 'lidar' else np.eye(4)

    def read(index):
        points, labels, _ = street[index]
        return SemanticScan(points @ T_frame_street[:3, :3].T + T_frame_street[:3, 3], labels)

    pipeline = Pipeline(Tracker(), config, None, extrinsic.configured(config))
    outcomes = [pipeline.process(stamped(street, index, frame, read=partial(read, index)))
                for index in (0, 2)]
    prepared = pipeline.tracker.reference.prepared
    up, origin = ((mount[2, :3], np.zeros(3)) if frame == 'lidar' else
                  ([0, 0, 1], mount[:3, 3]))
    np.testing.assert_allclose(prepared.up.direction, up, atol=1e-12)
    assert prepared.up.told
    T_base_cloud = np.eye(4) if frame == 'base' else mount
    scan = extrinsic.mounted(read(0), frame, T_base_cloud, config)
    np.testing.assert_allclose(scan.origin, origin)
    np.testing.assert_allclose(prepared.ground.normal, up, atol=0.02)
    metres, degrees = errors(outcomes[1].T_odom_child, relative(street[0][2], street[2][2]))
    assert metres < 0.15
    assert degrees < 0.3


@pytest.mark.parametrize('inverted', [False, True])
def test_the_transform_is_that_of_the_odometry(street, tmp_path, inverted):
    sink = Memory(tmp_path)
    config = StreamConfig(base_frame='base', T_base_sensor='1.2 -0.3 1.8 0.05 0.1 1.5')
    pipeline = Pipeline(Tracker(), config, sink, extrinsic.configured(config),
                        inverted_tf=inverted)
    for index in range(2):
        pipeline.process(stamped(street, index))
    odometry, transform = sink.of('odometry')[1], sink.of('/tf')[1].transforms[0]
    T = matrix_of_transform(transform.transform)
    np.testing.assert_allclose(np.linalg.inv(T) if inverted else T,
                               matrix_of(odometry.pose.pose), atol=1e-12)
    ends = (transform.header.frame_id, transform.child_frame_id)
    assert ends == (('base', 'odom') if inverted else ('odom', 'base'))


def test_only_what_a_sink_wants_is_made(street, tmp_path):
    sink = Memory(tmp_path, 'correspondences', '/tf')
    sink.without = 'visualization_msgs/msg/Marker'
    pipeline = Pipeline(Tracker(), StreamConfig(), sink)
    for index in range(2):
        assert pipeline.process(stamped(street, index)).reason == ''
    assert [topic for topic, *_ in sink.heard] == [
        'odometry', 'pose', 'relative_pose', 'odometry', 'pose']
    assert [arrived_ns for *_, arrived_ns in sink.heard] == [5, 5, *[PERIOD_NS + 5] * 3]


def test_a_late_scan_and_a_scan_without_a_name(street):
    pipeline = Pipeline(Tracker(), StreamConfig())
    first = pipeline.process(stamped(street, 0, frame='', stamp_ns=PERIOD_NS))
    assert (first.frame, first.row().restarted) == ('', True)
    np.testing.assert_array_equal(first.row().T_odom_child, np.eye(4))
    late = pipeline.process(stamped(street, 1, stamp_ns=PERIOD_NS))
    assert late.tracked.state is State.LATE
    assert late.row().T_odom_child is None
    assert late.row().reason == late.tracked.reason
    named = Pipeline(Tracker(), StreamConfig(sensor_frame='top'))
    assert named.process(stamped(street, 0, frame='/lidar')).frame == 'top'
