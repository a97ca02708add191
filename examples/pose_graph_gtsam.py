"""Relative poses into a pose graph of GTSAM.

`add_edge` takes the messages of the node's `relative_pose`; here the tracker makes the same ones.
"""
from typing import Any

import gtsam
import numpy as np
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.io.messages import relative_pose
from sgor_ros.world import simulate


def add_edge(graph: Any, edge: Any) -> None:
    """Add one nav_msgs/Odometry of `relative_pose`; the key of a pose is its stamp."""
    x, q = edge.pose.pose.position, edge.pose.pose.orientation
    T = gtsam.Pose3(gtsam.Rot3.Quaternion(q.w, q.x, q.y, q.z), np.array([x.x, x.y, x.z]))
    # rotation first, both in the frame of the scan
    turn = np.kron([[0, 1], [1, 0]], T.rotation().matrix().T)
    covariance = turn @ np.reshape(edge.pose.covariance, (6, 6)) @ turn.T
    target, source = (int(name.rpartition('@')[2])
                      for name in (edge.header.frame_id, edge.child_frame_id))
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    graph.add(gtsam.BetweenFactorPose3(target, source, T, noise))


def main() -> Any:
    """Track a few scans, put their edges into a graph and solve it."""
    types = get_typestore(Stores.ROS2_JAZZY).types.__getitem__
    tracker, graph, start = Tracker(), gtsam.NonlinearFactorGraph(), gtsam.Values()
    for seconds, points, labels, _ in simulate(4, seed=0):
        scan = tracker.track(SemanticScan(points, labels), round(1e9 * (1 + seconds)))
        if scan.T_odom_sensor is None:    # not registered: the next scan bridges the gap
            continue
        start.insert(scan.stamp_ns, gtsam.Pose3(scan.T_odom_sensor))
        if scan.T_reference_sensor is None:    # the first: the origin of the track
            graph.add(gtsam.PriorFactorPose3(scan.stamp_ns, gtsam.Pose3(),
                                             gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
        else:
            add_edge(graph, relative_pose(types, scan, 'lidar'))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    for key in solved.keys():  # noqa: SIM118, no mapping
        print(key, solved.atPose3(key).translation().round(3))
    return solved


if __name__ == '__main__':
    main()
