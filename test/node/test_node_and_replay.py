"""Node and replay give the same messages, bit by bit, for the same bag.

The node is a process of its own, and what is recorded in the bag comes to it over DDS as it is.
"""
import json

import pytest
import ros_helpers as ros
from ros_helpers import street
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from sgor_ros.commands.replay import main as replay
from sgor_ros.io.messages import point_cloud2
from sgor_ros.ros.playback.node_process import NodeProcess
from sgor_ros.ros.types import ros_type

STORE = get_typestore(Stores.ROS2_JAZZY)
CLOUD = 'sensor_msgs/msg/PointCloud2'
ODOMETRY = 'nav_msgs/msg/Odometry'
KINDS = {'/odometry': ODOMETRY, '/pose': 'geometry_msgs/msg/PoseStamped',
         '/relative_pose': ODOMETRY, '/correspondences': 'visualization_msgs/msg/MarkerArray'}
MOUNT = '1.2 -0.3 1.8 0.05 0.1 1.5'
SCANS = 7


def clouds():
    """Return clouds of a drive whose frame changes in the middle and whose third is broken."""
    types = STORE.types.__getitem__
    found = [point_cloud2(types, points, labels, stamp, 'lidar' if index < 4 else '/roof')
             for index, (stamp, points, labels, _) in enumerate(street(SCANS))]
    found[2].data = found[2].data[:1000]
    return found


def sound(clouds):
    """Return all but the broken cloud, in one frame."""
    for cloud in clouds:
        cloud.header.frame_id = 'lidar'
    return clouds[:2] + clouds[3:]


def record(path, clouds):
    """Write clouds to a bag; return it with the stamp and the bytes of each."""
    recorded = [(ros.stamp_ns_of(cloud.header), bytes(STORE.serialize_cdr(cloud, CLOUD)))
                for cloud in clouds]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection('/points', CLOUD, typestore=STORE)
        for stamp_ns, raw in recorded:
            bag.write(connection, stamp_ns, raw)
    return path, recorded


def replayed(bag, folder, settings):
    """Return summary, and what was written on each topic, of a replay with some settings."""
    options = [word for name, value in settings.items()
               for word in (f'--{name.replace("_", "-")}', value)]
    assert replay([str(bag), '--output', str(folder), '--bag', *options]) == 0
    found = {topic: [] for topic in KINDS}
    with AnyReader([folder / 'bag']) as reader:
        for connection, _, raw in reader.messages():
            found[connection.topic].append(canonical(raw, connection.msgtype))
    return json.loads((folder / 'summary.json').read_text()), found


def published(domain, recorded, folder, settings):
    """Return what a node says of each cloud, and what it published on each topic."""
    arguments = [word for name, value in settings.items() for word in ('-p', f'{name}:={value}')]
    raw = {topic: [] for topic in KINDS}
    with NodeProcess(domain, folder / 'log', *arguments) as node, ros.Partner(domain) as partner:
        partner.wait_for_node(node.alive)
        for topic, kind in KINDS.items():
            partner.node.create_subscription(ros_type(kind), topic, raw[topic].append, 100,
                                             raw=True)
            partner.spin_until(lambda topic=topic: partner.node.count_publishers(topic))
        partner.spin_for(1.0)
        told = [partner.outcome_of(stamp_ns, cloud) for stamp_ns, cloud in recorded]
        partner.spin_for(1.0)
        assert node.stop() == 0
    return told, {topic: [canonical(one, KINDS[topic]) for one in all_of_it]
                  for topic, all_of_it in raw.items()}


def canonical(raw, kind):
    """Return a message serialised anew: only the padding between fields is free."""
    return bytes(STORE.serialize_cdr(STORE.deserialize_cdr(raw, kind), kind))


@pytest.mark.parametrize(('change', 'settings'), [
    (sound, {}),
    (list, {}),
    (list, {'base_frame': 'base_link', 'T_base_sensor': MOUNT, 'mode': 'consecutive'}),
    (sound, {'sensor_frame': 'top', 'odom_frame': 'map', 'label_field': 'none'}),
], ids=['sound', 'broken, frames change', 'base', 'names'])
def test_the_same_messages_bit_by_bit(domain, tmp_path, change, settings):
    bag, recorded = record(tmp_path / 'bag', change(clouds()))
    summary, expected = replayed(bag, tmp_path / 'out', settings)
    told, found = published(domain, recorded, tmp_path, settings)
    assert {topic: len(all_of_it) for topic, all_of_it in expected.items()} == {
        '/odometry': SCANS - 1, '/pose': SCANS - 1, '/relative_pose': SCANS - 2,
        '/correspondences': SCANS - 1}
    for topic in KINDS:
        assert found[topic] == expected[topic], topic
    # and they say the same of what is not published
    failed = [(stamp_ns, message) for (stamp_ns, _), (_, message, values)
              in zip(recorded, told, strict=True) if 'state' not in values]
    assert failed == [(failure['stamp_ns'], f'unusable cloud: {failure["reason"]}')
                      for failure in summary['failures']]
    assert told[-1][2]['processed'] == str(summary['successes'])
    assert told[-1][2]['failed'] == str(len(summary['failures'])) == str(
        len(recorded) - summary['successes'])


def test_what_a_change_of_frames_does(tmp_path):
    """The edge names the frame of the reference, and no motion is told of two sensors."""
    bag, _ = record(tmp_path / 'bag', clouds())
    summary, found = replayed(bag, tmp_path / 'out', {})
    edges = [STORE.deserialize_cdr(raw, ODOMETRY)
             for raw in found['/relative_pose']]
    stamps = [stamp for stamp, *_ in street(SCANS)]
    assert [edge.header.frame_id for edge in edges][2:4] == [f'lidar@{stamps[0]}'] * 2
    assert [edge.child_frame_id for edge in edges][2:] == [
        f'roof@{stamp}' for stamp in stamps[4:]]
    speeds = [STORE.deserialize_cdr(raw, ODOMETRY).twist.twist.linear.x
              for raw in found['/odometry']]
    # the first has nothing to move from; then the third was broken, and the fifth is another's
    assert [speed == 0 for speed in speeds] == [True, False, False, True, False, False]
    assert summary['warnings'].count('the frame of the clouds changed from lidar to roof') == 1
    assert [failure['scan'] for failure in summary['failures']] == [2]
