"""Odometry of a bag, without ROS: mcap, sqlite3 or a ROS 1 .bag.

`sgor_replay BAG` does this and more; here is how to do it yourself.
"""
from pathlib import Path
import sys
import tempfile

from sgor_ros import TrackedScan
from sgor_ros import Tracker
from sgor_ros.io.bags import BagReader
from sgor_ros.io.bags import BagWriter
from sgor_ros.io.label_field import label_field_of
from sgor_ros.io.messages import point_cloud2
from sgor_ros.io.pointcloud2 import decode
from sgor_ros.world import simulate


def record(path: Path) -> None:
    """Write a bag of the built-in street, so that there is one to read."""
    with BagWriter(path) as bag:
        for seconds, points, labels, _ in simulate(5, seed=0):
            stamp_ns = round(1e9 * (1 + seconds))
            bag.write('/points', point_cloud2(bag.types, points, labels, stamp_ns, 'lidar'),
                      stamp_ns)


def odometry(path: Path) -> list[TrackedScan]:
    """Track all clouds of a bag."""
    tracker, tracked = Tracker(), []
    with BagReader(path) as bag:
        for recorded in bag.clouds(bag.find_topic('auto')):    # the one topic with labels
            stamp_ns, _, message = recorded.read()
            scan = decode(message, label_field_of(message, 'auto'))
            tracked.append(tracker.track(scan, stamp_ns))
    return tracked


def main(arguments: list[str]) -> list[TrackedScan]:
    """Track the bag that is named, or one of the built-in street."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(arguments[0]) if arguments else Path(folder) / 'street'
        if not arguments:
            record(path)
        tracked = odometry(path)
    for scan in tracked:
        where = 'no pose' if scan.T_odom_sensor is None else scan.T_odom_sensor[:3, 3].round(3)
        print(scan.stamp_ns, scan.state, where, scan.reason)
    return tracked


if __name__ == '__main__':
    main(sys.argv[1:])
