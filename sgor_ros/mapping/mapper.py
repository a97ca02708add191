"""The way of a scan through the mapper, on one screen."""
from dataclasses import fields
import logging

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.config import prepares_alike
from ..core.config import SgorConfig
from ..core.prepared_scan import PreparedScan
from ..core.registration import register
from ..core.scan.scan import SemanticScan
from ..tracker import TrackedScan
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .candidates import Candidate
from .candidates import Candidates
from .candidates import candidates_of
from .candidates import is_covered
from .config import MapperConfig
from .edge import Edge
from .edge import Kind
from .keyframe import Keyframes
from .loop_consistency import LoopConsistency
from .odometry import Node
from .odometry import Odometry
from .pose_graph import PoseGraph
from .result import Loop
from .result import MappedScan
from .result import Trajectory

Array = NDArray[np.float64]

LOGGER = logging.getLogger('sgor_ros')


class Mapper:
    """Tracks each scan, closes loops among keyframes, and keeps all poses optimised.

    Attributes
    ----------
    tracker : Tracker
    mapper_config : MapperConfig
    graph : PoseGraph
    keyframes : Keyframes
    consistency : LoopConsistency
    """

    def __init__(self, config: SgorConfig | None = None,
                 tracker_config: TrackerConfig | None = None,
                 mapper_config: MapperConfig | None = None) -> None:
        self.tracker = Tracker(config, tracker_config)
        self.mapper_config = MapperConfig.given(mapper_config)
        self.graph = PoseGraph()
        self.keyframes = Keyframes()
        self.consistency = LoopConsistency()
        self._odometry = Odometry()
        self._candidates = Candidates()

    def track(self, scan: SemanticScan, stamp_ns: int) -> MappedScan:
        """Take the next scan: its pose by odometry, and the loops that it closed."""
        tracked = self.tracker.track(scan, stamp_ns)
        keyframe = self.tracker.reference if tracked.keyframe else None
        return self.add(tracked, None if keyframe is None else keyframe.prepared)

    def add(self, tracked: TrackedScan, prepared: PreparedScan | None) -> MappedScan:
        """Take a scan that has been tracked; prepared, where the tracker made a keyframe of it."""
        if tracked.T_odom_sensor is not None:
            added = self._odometry.add(tracked, self.tracker.tracker_config)
            if added is not None:
                assert prepared is not None
                self._add_node(*added, prepared)
        loops = self._work()
        return MappedScan(**{item.name: getattr(tracked, item.name) for item in fields(tracked)},
                          loops=tuple(self._loop_of(edge) for edge in loops),
                          T_map_odom=self._T_map_odom(tracked))

    def trajectory(self) -> Trajectory:
        """Return the optimised pose of every scan that has one."""
        return self._odometry.trajectory(
            self.graph.poses, {node: self.graph.part(node) for node in self.graph.poses})

    def _add_node(self, node: Node, edge: Edge | None, prepared: PreparedScan) -> None:
        c = self.mapper_config
        if edge is None:
            self.graph.add_origin(node.id, np.eye(4))
        else:
            self.graph.add_node(edge)
            self.consistency.paths.add(edge)
        if c.registrations_per_scan:
            self._candidates.add(node, prepared, candidates_of(
                node, prepared, self.keyframes, self.graph, self.consistency.paths,
                self._odometry.nodes, c), c.waiting)
        if not is_covered(node, self.keyframes, self.graph, self.consistency.paths,
                          c.keyframe_spacing * prepared.scale):
            self.keyframes.add(node.id, node.stamp_ns, node.track_id, prepared)

    def _work(self) -> list[Edge]:
        """Register candidates, as many as there is time for; return the loops believed now."""
        closed: list[Edge] = []
        for _ in range(self.mapper_config.registrations_per_scan):
            candidate = self._candidates.next()
            if candidate is None:
                break
            loop = self._registered(candidate)
            if loop is not None:
                self._candidates.done(candidate.source)
                closed += self.consistency.offer(loop, self.mapper_config)
        if closed:
            self.graph.close(closed)
        return closed

    def _registered(self, candidate: Candidate) -> Edge | None:
        """Register a pair; a loop only where the clouds leave one answer, in all directions."""
        target = self.keyframes.restored(candidate.target)
        source = candidate.prepared
        if source.scale != target.scale or not prepares_alike(source.config, target.config):
            return None
        found = register(source, target, self.tracker.config)
        if not found.success or found.T_target_source is None or found.covariance is None:
            return None
        return Edge(candidate.target, candidate.source, found.T_target_source, found.covariance,
                    Kind.LOOP)

    def _loop_of(self, edge: Edge) -> Loop:
        nodes = self._odometry.nodes
        return Loop(nodes[edge.source].stamp_ns, nodes[edge.target].stamp_ns,
                    edge.T_target_source, edge.covariance)

    def _T_map_odom(self, tracked: TrackedScan) -> Array | None:
        if tracked.T_odom_sensor is None:
            return None
        node = self._odometry.last(tracked.track_id)
        return self.graph.poses[node.id] @ se3.inverse(node.T_odom_sensor)
