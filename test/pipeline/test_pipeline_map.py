"""What the pipeline publishes where loops are closed."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from return_drive import return_drive
from return_drive import THERE
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from sgor_ros import Mapper
from sgor_ros import SemanticScan
from sgor_ros.core.common import se3
from sgor_ros.io.frames import parse_transform
from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import matrix_of
from sgor_ros.io.messages import matrix_of_transform
from sgor_ros.io.pointcloud2 import decode
from sgor_ros.io.sequence import StampedScan
from sgor_ros.io.stream_config import StreamConfig
from sgor_ros.pipeline import extrinsic
from sgor_ros.pipeline.pipeline import Pipeline

pytest.importorskip('gtsam')

MOUNT = '1.2 -0.3 1.8 0.05 0.1 1.5'
T_BASE_SENSOR = parse_transform(MOUNT, 'mount')
START_NS, PERIOD_NS = 5_000_000_000, 100_000_000


class Kept:
    """A sink that wants and keeps everything."""

    types = staticmethod(get_typestore(Stores.ROS2_JAZZY).types.__getitem__)

    def __init__(self):
        self.written = []

    def wants(self, topic):
        return True

    def write(self, topic, message, arrived_ns):
        self.written.append((topic, message))

    def of(self, topic):
        return [message for of, message in self.written if of == topic]

    def transforms(self, frame, child):
        """Return stamp to pose of the transforms between two frames."""
        found = [message.transforms[0] for message in self.of('/tf')]
        return {stamp_ns_of(one.header): matrix_of_transform(one.transform) for one in found
                if (one.header.frame_id, one.child_frame_id) == (frame, child)}


def played(drive, **options):
    """Return what is published of a drive, and the pipeline."""
    config = StreamConfig(base_frame='base_link', T_base_sensor=MOUNT)
    sink = Kept()
    pipeline = Pipeline(Mapper(), config, sink, extrinsic.configured(config), **options)
    for i, (points, labels, _) in enumerate(drive):
        stamp_ns = START_NS + i * PERIOD_NS
        scan = SemanticScan(points, labels)
        outcome = pipeline.process(StampedScan(stamp_ns, 'lidar', lambda scan=scan: scan, 0))
        assert 'fault' not in outcome.reason
    return sink, pipeline


def base_in_map(drive, stamp_ns):
    """Return the true pose of the base; the map begins where it began."""
    true = [drive[i][2] @ se3.inverse(T_BASE_SENSOR)
            for i in (0, (stamp_ns - START_NS) // PERIOD_NS)]
    return relative(*true)


def assert_in_map(sink, drive, stamp_ns, T_map_odom, T_odom_base):
    metres, degrees = errors(T_map_odom @ T_odom_base, base_in_map(drive, stamp_ns))
    assert metres < 0.2
    assert degrees < 1.0


def test_map_to_odom_and_odom_to_base_lead_to_the_place_of_the_base():
    drive = return_drive()
    sink, pipeline = played(drive)
    to_map, to_odom = sink.transforms('map', 'odom'), sink.transforms('odom', 'base_link')
    assert len(to_map) == len(to_odom) == len(drive)
    for stamp_ns, T in to_odom.items():
        assert_in_map(sink, drive, stamp_ns, to_map[stamp_ns], T)
    np.testing.assert_allclose(next(iter(to_map.values())), np.eye(4), atol=1e-12)
    loops = sink.of('loop_closure')
    assert len(loops) == len(pipeline.mapper.graph.loops)
    for loop in loops:
        target, source = (int(name.removeprefix('lidar@')) for name in (
            loop.header.frame_id, loop.child_frame_id))
        assert target < source == stamp_ns_of(loop.header)
        true = relative(*(drive[(of - START_NS) // PERIOD_NS][2] for of in (target, source)))
        assert errors(matrix_of(loop.pose.pose), true)[0] < 0.1
        assert (np.linalg.eigvalsh(np.reshape(loop.pose.covariance, (6, 6))) > 0).all()


def test_path_and_cloud_lie_in_the_map():
    drive = return_drive()[:8]
    sink, pipeline = played(drive)
    path = sink.of('path')[-1]
    assert path.header.frame_id == 'map'
    assert len(path.poses) == len(pipeline.mapper.graph)
    for stamped in path.poses:
        stamp_ns = stamp_ns_of(stamped.header)
        sensor = base_in_map(drive, stamp_ns) @ T_BASE_SENSOR
        assert errors(matrix_of(stamped.pose), sensor)[0] < 0.1
    cloud = sink.of('map_cloud')[-1]
    points = decode(cloud, 'label').points
    assert len(points) > 5000
    # the ground below the first base, whose mount is tilted
    ground = points[np.linalg.norm(points[:, :2], axis=1) < 10]
    up = T_BASE_SENSOR[:3, :3] @ np.array([0, 0, 1.0])
    heights = (ground - T_BASE_SENSOR[:3, 3]) @ up
    assert np.percentile(heights, 10) == pytest.approx(-1.73, abs=0.3)


def test_odom_does_not_jump_where_a_track_begins_and_the_map_is_right():
    """A kidnapped base: odom goes on with a covariance that says so, the map has the place."""
    drive = [*return_drive()[:THERE], *return_drive()[-3:]]
    sink, pipeline = played(drive)
    assert pipeline.mapper.graph.nodes
    poses = {stamp_ns_of(one.header): one for one in sink.of('odometry')}
    before, after = (poses[START_NS + i * PERIOD_NS] for i in (THERE - 1, THERE + 1))
    moved = relative(*(matrix_of(one.pose.pose) for one in (before, after)))
    assert 2 < np.linalg.norm(moved[:3, 3]) < 6    # 20 m/s for 0.2 s, as it would have gone on
    sigma = np.sqrt(np.diag(np.reshape(after.pose.covariance, (6, 6))))
    assert sigma[:2] == pytest.approx([6.0, 6.0], abs=0.5)    # half of 60 m/s for 0.2 s
    assert sigma[5] > 1
    to_map, to_odom = sink.transforms('map', 'odom'), sink.transforms('odom', 'base_link')
    for i in (THERE + 1, THERE + 2):
        stamp_ns = START_NS + i * PERIOD_NS
        assert_in_map(sink, drive, stamp_ns, to_map[stamp_ns], to_odom[stamp_ns])


def test_inverted_the_map_hangs_on_odom():
    drive = return_drive()[:3]
    sink, _ = played(drive, inverted_tf=True)
    assert len(sink.transforms('odom', 'map')) == len(sink.transforms('base_link', 'odom')) == 3
    assert not sink.transforms('map', 'odom')
