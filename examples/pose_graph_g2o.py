"""Relative poses into a file of g2o.

Vertices are small numbers there, so keep their stamps beside the file.
"""
from typing import Any

import numpy as np
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.io.messages import relative_pose
from sgor_ros.world import simulate


def edge_line(edge: Any, number_of: dict[int, int]) -> str:
    """Return the line of one nav_msgs/Odometry of `relative_pose`; stamp to number of vertex."""
    x, q = edge.pose.pose.position, edge.pose.pose.orientation
    numbers = [x.x, x.y, x.z, q.x, q.y, q.z, q.w]
    R = Rotation.from_quat(numbers[3:]).as_matrix()
    # translation first, in the frame of the scan; of the rotation the vector part of the
    # quaternion, which is half the rotation vector
    turn = np.kron(np.diag([1, 0.5]), R.T)
    information = np.linalg.inv(turn @ np.reshape(edge.pose.covariance, (6, 6)) @ turn.T)
    target, source = (number_of[int(name.rpartition('@')[2])]
                      for name in (edge.header.frame_id, edge.child_frame_id))
    values = ' '.join(f'{value:.12g}' for value in [*numbers, *information[np.triu_indices(6)]])
    return f'EDGE_SE3:QUAT {target} {source} {values}'


def main() -> str:
    """Track a few scans and print the file."""
    types = get_typestore(Stores.ROS2_JAZZY).types.__getitem__
    tracker, number_of = Tracker(), dict[int, int]()
    vertices, edges = [], []
    for seconds, points, labels, _ in simulate(4, seed=0):
        scan = tracker.track(SemanticScan(points, labels), round(1e9 * (1 + seconds)))
        if scan.T_odom_sensor is None:
            continue
        number = number_of[scan.stamp_ns] = len(number_of)
        pose = (*scan.T_odom_sensor[:3, 3],
                *Rotation.from_matrix(scan.T_odom_sensor[:3, :3]).as_quat())
        vertices.append(f'VERTEX_SE3:QUAT {number} ' + ' '.join(f'{value:.12g}' for value in pose))
        if scan.T_reference_sensor is not None:
            edges.append(edge_line(relative_pose(types, scan, 'lidar'), number_of))
    text = '\n'.join([*vertices, 'FIX 0', *edges]) + '\n'
    print(text, end='')
    return text


if __name__ == '__main__':
    main()
