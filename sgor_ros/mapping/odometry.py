"""From tracked scans to nodes and odometry edges of the graph, and back to a pose of each scan."""
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..tracker import TrackedScan
from ..tracker import TrackerConfig
from ..tracker.choice import or_unknown
from .edge import Edge
from .pose_graph import PoseGraph
from .result import Trajectory
from .scan_poses import ScanPoses

Array = NDArray[np.float64]

LEAST = np.diag([1e-3**2] * 3 + [1e-4**2] * 3)
"""What no edge goes below, m^2 and rad^2: a covariance has to be one."""


@dataclass(frozen=True, eq=False)
class Node:
    """A scan that is a node of the graph.

    Attributes
    ----------
    id : int
        The keyframe's id of the tracker, after those of a map that was there before.
    stamp_ns : int
    track_id : int
    T_odom_sensor : (4, 4) float64
    covariance : (6, 6) float64 or None
        Of the pose since the start of the track, in the odom frame.
    way : float
        Metres driven since the first scan of all; minus infinity for those of a map that was there
        before, which are no part of the drive.
    """

    id: int
    stamp_ns: int
    track_id: int
    T_odom_sensor: Array
    covariance: Array | None
    way: float


class Odometry:
    """Nodes out of the keyframes of the tracker, and all scans hung on them.

    Parameters
    ----------
    known : iterable of Node
        Those of a map that was there before. Nodes of the tracker are numbered after them.

    Attributes
    ----------
    nodes : dict of int to Node
    first : int
        The lowest number that one of the tracker can have.
    """

    def __init__(self, known: Iterable[Node] = ()) -> None:
        self.nodes: dict[int, Node] = {node.id: node for node in known}
        self.first = max(self.nodes, default=-1) + 1
        self._last: dict[int, Node] = {}
        self._scans = ScanPoses()
        self._way = 0.0
        self._before: tuple[int, Array] | None = None

    def add(self, tracked: TrackedScan, config: TrackerConfig) -> tuple[Node, Edge | None] | None:
        """Take the next scan that has a pose.

        Returns
        -------
        (Node, Edge or None) or None
            The node that it became and the edge from the node before; no edge where a track
            begins. None where it only hangs on a node.
        """
        T, track = tracked.T_odom_sensor, tracked.track_id
        assert T is not None
        if self._before is not None and self._before[0] == track:
            self._way += float(np.linalg.norm(T[:3, 3] - self._before[1][:3, 3]))
        self._before = track, T
        # in consecutive mode each scan is the reference of the next, and few become nodes
        reference = None if tracked.reference_id is None else tracked.reference_id + self.first
        on = self._last.get(track)
        if reference is not None:
            on = self.nodes.get(reference, on)
        if tracked.keyframe_id is None or (
                on is not None and config.mode == 'consecutive' and not _is_far(on, T, config)):
            assert on is not None, 'a track begins with a keyframe'
            self._scans.add(tracked.stamp_ns, on.id, se3.inverse(on.T_odom_sensor) @ T)
            return None
        node = Node(tracked.keyframe_id + self.first, tracked.stamp_ns, track, T,
                    tracked.covariance, self._way)
        self.nodes[node.id] = self._last[track] = node
        self._scans.add(tracked.stamp_ns, node.id, np.eye(4))
        return node, None if on is None else edge_between(on, node, (
            tracked.reference_covariance if on.id == reference else None))

    @property
    def last_nodes(self) -> list[int]:
        """The newest node of each track."""
        return [node.id for node in self._last.values()]

    def last(self, track_id: int) -> Node:
        """Return the newest node of a track."""
        return self._last[track_id]

    def last_pose(self, graph: PoseGraph) -> Array:
        """Return T_map_sensor of the last scan that has a pose; the origin before the first."""
        if not len(self._scans):
            return np.eye(4)
        node, T_node_sensor = self._scans.last()
        return graph.pose(node) @ T_node_sensor

    def node_at(self, stamp_ns: int) -> int:
        """Return the node of a stamp.

        Raises
        ------
        InputError
            There is none.
        """
        for node in reversed(self.nodes.values()):    # those of a map before come last
            if node.stamp_ns == stamp_ns:
                return node.id
        raise InputError(f'stamp_ns = {stamp_ns}: that of no keyframe')

    def trajectory(self, graph: PoseGraph, *, loops: bool = True) -> Trajectory:
        """Return the pose of each scan in the map, or by odometry alone."""
        held, rows = np.unique(self._scans.nodes, return_inverse=True)
        nodes = held.tolist()
        poses = graph.poses(nodes) if loops else graph.poses_by_odometry(nodes)
        return Trajectory(
            self._scans.stamps_ns, poses[rows] @ self._scans.T_node_sensor,
            np.array([graph.part(node) for node in nodes], np.int64)[rows])

    def forget(self, bases: Mapping[int, tuple[int, Array]]) -> None:
        """Forget nodes; their scans go on others, with T_other_node (4, 4)."""
        self._scans.move(bases)
        for node in bases:
            del self.nodes[node]


def edge_between(target: Node, source: Node, step: Array | None = None) -> Edge:
    """Return the odometry edge of two nodes of a track, the source being the later.

    Its covariance is by how much that of the pose has grown between them. Errors that repeat from
    step to step are in it with all that they add to those before, so that edges may be counted as
    independent of each other. It never goes below `step`, (6, 6), that of the registration of one
    to the other, where there was one: on a way back errors that repeat undo those before.
    """
    T = se3.inverse(target.T_odom_sensor) @ source.T_odom_sensor
    if target.covariance is None or source.covariance is None:
        covariance = or_unknown(step)
    else:
        carry = se3.carried(source.T_odom_sensor[:3, 3] - target.T_odom_sensor[:3, 3])
        back = se3.turned(target.T_odom_sensor[:3, :3].T)
        growth = back @ (source.covariance - carry @ target.covariance @ carry.T) @ back.T
        covariance = _at_least(growth, LEAST if step is None else step)
    return Edge(target.id, source.id, T, covariance)


def _at_least(covariance: Array, least: Array) -> Array:
    """Return a (6, 6) covariance that is widened where it is below another."""
    root = np.linalg.cholesky(least)
    back = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(back @ (covariance + covariance.T) @ back.T / 2)
    widened = root @ (vectors * np.maximum(values, 1.0)) @ vectors.T @ root.T
    return np.asarray((widened + widened.T) / 2)


def _is_far(node: Node, T_odom_sensor: Array, config: TrackerConfig) -> bool:
    T = se3.inverse(node.T_odom_sensor) @ T_odom_sensor
    return (float(np.linalg.norm(T[:3, 3])) > config.keyframe_distance
            or se3.angle(T[:3, :3]) > config.keyframe_angle)
