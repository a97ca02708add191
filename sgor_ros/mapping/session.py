"""One drive, in a map of before or a new one: its nodes in the pose graph, its scans on them."""
from collections.abc import Container
from collections.abc import Mapping
import math

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.config import SgorConfig
from ..tracker import TrackedScan
from ..tracker import TrackerConfig
from ..tracker.keyframes import Keyframe
from .config import MapperConfig
from .edge import Edge
from .edge import Kind
from .maps.map import Map
from .maps.map import MapNode
from .odometry import Node
from .odometry import Odometry
from .pose_graph import PoseGraph
from .result import Loop
from .result import Trajectory
from .trimming import edges_without
from .trimming import too_many

Array = NDArray[np.float64]

FROM_A_MAP = 0
"""In place of the track of nodes that were there before; those of the tracker count from 1."""


class Session:
    """What is known of a drive, and of the map that it goes on in.

    Parameters
    ----------
    known : Map
        Without nodes where the drive begins a map.

    Attributes
    ----------
    known : Map
    graph : PoseGraph
        Nodes of that map and of the drive.
    keyframes : Keyframes
        Those of them whose scans are kept.
    """

    def __init__(self, known: Map) -> None:
        self.known = known
        self.graph = PoseGraph()
        self.graph.add_map({node.id: node.T_map_sensor for node in known.nodes.values()},
                           known.edges)
        self.keyframes = known.keyframes.copy()
        self._odometry = Odometry(
            Node(node.id, node.stamp_ns, FROM_A_MAP, node.T_map_sensor, None, -math.inf)
            for node in known.nodes.values())

    @property
    def nodes(self) -> Mapping[int, Node]:
        """All nodes of the graph."""
        return self._odometry.nodes

    def node_of(self, keyframe_id: int) -> int:
        """Return the node that a keyframe of the tracker is, if it is one."""
        return keyframe_id + self._odometry.first

    def add(self, tracked: TrackedScan, config: TrackerConfig) -> tuple[Node, Edge | None] | None:
        """Take the next scan that has a pose; put the node that it became into the graph.

        A track begins where the last scan was: as good a guess as any until a loop joins it.

        Returns
        -------
        (Node, Edge or None) or None
            As of `Odometry.add`.
        """
        last = self.last_pose()
        added = self._odometry.add(tracked, config)
        if added is not None:
            node, edge = added
            if edge is None:
                self.graph.add_origin(node.id, last)
            else:
                self.graph.add_node(edge)
        return added

    def keep_deskewed(self, reference: Keyframe | None) -> None:
        """Keep a keyframe of the tracker anew whose motion was known only with the next scan."""
        node = None if reference is None else self.node_of(reference.id)
        if reference is None or node is None or node not in self.keyframes:
            return
        kept = self.keyframes[node]
        if kept.frame_covariance is not reference.prepared.frame_covariance:
            self.keyframes.add(kept.id, kept.stamp_ns, kept.track_id, reference.prepared)

    def trim(self, map_nodes: Container[int]) -> bool:
        """Let the oldest nodes of the drive go where there are many; return whether any went.

        Those of the map and of keyframes stay, and the last of each track, which may come back.
        Scans on nodes that go stay where they are, seen from the first node of their part.
        """
        stay = {node for node in self.graph.nodes if node in map_nodes or node in self.keyframes}
        going = set(too_many(self.graph, stay.union(self._odometry.last_nodes)))
        if not going:
            return False
        kept = [node for node in self.graph.nodes if node not in going]
        firsts: dict[int, int] = {}
        for node in kept:
            firsts.setdefault(self.graph.part(node), node)
        bases = {}
        for node in going:
            first = firsts[self.graph.part(node)]
            bases[node] = first, se3.inverse(self.graph.pose(first)) @ self.graph.pose(node)
        self.graph.keep(kept, edges_without(self.graph, going))
        self._odometry.forget(bases)
        return True

    def last_pose(self) -> Array:
        """Return T_map_sensor of the last scan that has a pose; the origin before the first."""
        return self._odometry.last_pose(self.graph)

    def is_in_map(self, node: int) -> bool:
        """Whether a node is joined to the map that was there before; without one, all are."""
        return not self.known.nodes or (
            self.graph.part(node) == self.graph.part(next(iter(self.known.nodes))))

    def T_map_odom(self, tracked: TrackedScan) -> Array | None:
        """Return where the frame of a scan's track lies in the map, as of `MappedScan`."""
        if tracked.T_odom_sensor is None:
            return None
        node = self._odometry.last(tracked.track_id)
        if not self.is_in_map(node.id):
            return None
        return self.graph.pose(node.id) @ se3.inverse(node.T_odom_sensor)

    def loop_of(self, edge: Edge) -> Loop:
        """Return an edge as it is told of, by stamps."""
        return Loop(self.nodes[edge.source].stamp_ns, self.nodes[edge.target].stamp_ns,
                    edge.T_target_source, edge.covariance)

    def edge_of(self, loop: Loop) -> Edge:
        """Return the edge of a loop that is told of by stamps.

        Raises
        ------
        InputError
            One of them is of no node.
        """
        source, target = (self._odometry.node_at(stamp_ns) for stamp_ns in (
            loop.source_stamp_ns, loop.target_stamp_ns))
        return Edge(target, source, loop.T_target_source, loop.covariance, Kind.LOOP)

    def trajectory(self, *, loops: bool = True) -> Trajectory:
        """Return the pose of every scan that has one, optimised or by odometry alone."""
        return self._odometry.trajectory(self.graph, loops=loops)

    def as_map(self, config: SgorConfig, tracker_config: TrackerConfig,
               mapper_config: MapperConfig, T_base_sensor: Array | None) -> Map:
        """Return the largest part of the map, or what is joined to the one before."""
        known = self.known
        chosen = self.graph.largest_part(next(iter(known.nodes), None))
        session = max(known.sessions, default=-1) + 1
        return Map(
            {node: MapNode(node, self.nodes[node].stamp_ns,
                           known.nodes[node].session if node in known.nodes else session, T.copy())
             for node, T in chosen.items()},
            tuple(edge for edge in self.graph.edges if edge.source in chosen),
            self.keyframes.copy(chosen), config, tracker_config, mapper_config, T_base_sensor)
