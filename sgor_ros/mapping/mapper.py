"""The way of a scan through the mapper, on one screen."""
from concurrent.futures import Executor
from dataclasses import fields
from itertools import combinations
import math

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.prepared_scan import PreparedScan
from ..core.preprocessing import preprocess
from ..core.scan.scan import SemanticScan
from ..tracker import State
from ..tracker import TrackedScan
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .candidates import Candidate
from .candidates import Candidates
from .candidates import Surroundings
from .config import MapperConfig
from .edge import Edge
from .edge import Kind
from .edge import NO_NODE
from .loop_consistency import LoopConsistency
from .maps.map import Map
from .maps.map import MapNode
from .odometry import Node
from .odometry import Odometry
from .pose_graph import PoseGraph
from .relocalisation import Relocalisation
from .result import Loop
from .result import MappedScan
from .result import Trajectory
from .verification import Verification

Array = NDArray[np.float64]

FROM_A_MAP = 0
"""In place of the track of nodes that were there before; those of the tracker count from 1."""


class Mapper:
    """Tracks each scan, closes loops among keyframes, and keeps all poses optimised.

    Without GTSAM it goes on as odometry, and says so once.

    Parameters
    ----------
    config : SgorConfig, optional
    tracker_config : TrackerConfig, optional
    mapper_config : MapperConfig, optional
    executor : concurrent.futures.Executor, optional
        Where candidates of loops are registered, in processes of its own; without it here, with
        each scan a few.
    map : Map, optional
        To go on in: the sensor is somewhere in it, or will come there. Poses are in its frame once
        it is found. Settings that are not given are those of the map.

    Raises
    ------
    InputError
        The map was made with a configuration that does not go with this one.

    Attributes
    ----------
    tracker : Tracker
    mapper_config : MapperConfig
    graph : PoseGraph
        A node for each keyframe of the tracker.
    keyframes : Keyframes
        Those of them whose scans are kept.
    consistency : LoopConsistency
    candidates : Candidates
    T_base_sensor : (4, 4) array or None
        As of `Map`; for who knows it to set.
    """

    def __init__(self, config: SgorConfig | None = None,
                 tracker_config: TrackerConfig | None = None,
                 mapper_config: MapperConfig | None = None, *,
                 executor: Executor | None = None, map: Map | None = None) -> None:
        if map is not None:
            config, tracker_config, mapper_config = map.settings(config, tracker_config,
                                                                 mapper_config)
        self.tracker = Tracker(config, tracker_config)
        self.mapper_config = MapperConfig.given(mapper_config)
        self._executor = executor
        self._begin_in(Map() if map is None else map)

    def begin_in(self, known: Map) -> None:
        """Go on in another map, lost at first; what was mapped until now is dropped.

        Raises
        ------
        InputError
            It was made with a configuration that does not go with this one.
        """
        known.settings(self.tracker.config, None, None)
        self.tracker.reset()
        self._begin_in(known)

    def _begin_in(self, known: Map) -> None:
        self.graph = PoseGraph()
        self.graph.add_map({node.id: node.T_map_sensor for node in known.nodes.values()},
                           known.edges)
        self.keyframes = known.keyframes.copy()
        self.consistency = LoopConsistency()
        self.consistency.begin_anew(known.edges)
        self.candidates = Candidates()
        self.T_base_sensor = known.T_base_sensor
        self._known = known
        self._relocalisation = Relocalisation(known)
        self._frozen: Map | None = None
        self._found: list[Edge] = []    # loops to it that are told of with this scan
        self._odometry = Odometry(
            Node(node.id, node.stamp_ns, FROM_A_MAP, node.T_map_sensor, None, -math.inf)
            for node in known.nodes.values())
        self._verification = Verification(self._executor)
        self._closes_loops = bool(self.mapper_config.registrations_per_scan
                                  and not self.graph.missing)
        self._notes = [self.graph.missing] if self.graph.missing else []

    def track(self, scan: SemanticScan, stamp_ns: int) -> MappedScan:
        """Take the next scan: its pose by odometry, and the loops that it closed.

        Parameters
        ----------
        scan : SemanticScan
        stamp_ns : int
            Its stamp, nanoseconds, as of `Tracker.track`.
        """
        tracked = self.tracker.track(scan, stamp_ns)
        if tracked.state in (State.FAILED, State.LOST) and self._is_elsewhere(scan):
            self.tracker.begin_track()
            self._notes.append('the sensor is at another place of the map: a new track begins')
        self._keep_deskewed()
        if self._relocalisation.hint_is_new:
            self._look_again()
        keyframe = self.tracker.reference if tracked.keyframe else None
        return self.add(tracked, None if keyframe is None else keyframe.prepared)

    def add(self, tracked: TrackedScan, prepared: PreparedScan | None) -> MappedScan:
        """Take a scan that has been tracked; prepared, where the tracker made a keyframe of it."""
        if tracked.T_odom_sensor is not None:
            T_map_sensor = self._odometry.last_pose(self.graph)
            added = self._odometry.add(tracked, self.tracker.tracker_config)
            if added is not None:
                assert prepared is not None, 'a keyframe comes with its prepared scan'
                self._add_node(*added, prepared, T_map_sensor)
        # where a track begins, its place in the map is what the scan is waited for
        loops = [*self._found, *self._work(at_once=tracked.restarted)]
        self._found = []
        notes, self._notes = self._notes, []
        told = {item.name: getattr(tracked, item.name) for item in fields(tracked)}
        hypotheses: tuple[Array, ...] = ()
        T_map_odom = self._T_map_odom(tracked)
        if T_map_odom is not None:
            self._relocalisation.forget_hint()
        elif tracked.T_odom_sensor is not None:
            hypotheses = self._relocalisation.hypotheses(tracked.track_id, tracked.T_odom_sensor)
        return MappedScan(**{**told, 'warnings': (*tracked.warnings, *notes)},
                          loops=tuple(self._loop_of(edge) for edge in loops),
                          T_map_odom=T_map_odom, hypotheses=hypotheses)

    def hint(self, T_map_sensor: ArrayLike) -> None:
        """Look for the sensor near a pose, (4, 4), first, as long as it is lost.

        It may be wrong: where nothing there registers, all of the map is looked through.

        Raises
        ------
        InputError
            It is no pose.
        """
        self._relocalisation.give_hint(T_map_sensor)

    def freeze(self, frozen: bool = True) -> None:
        """Follow the map as it is from now on and add nothing to it, or add again.

        Until then, `map` is what it is now.

        Raises
        ------
        InputError
            There are no keyframes to follow.
        """
        if frozen and not len(self.map.keyframes):
            raise InputError('there is no map to follow: it has no keyframes')
        self._frozen = self.map if frozen else None

    @property
    def begun_in_map(self) -> bool:
        """Whether there was a map before, in whose frame poses are."""
        return bool(self._known.nodes)

    @property
    def frozen(self) -> bool:
        """Whether nothing is added to the map."""
        return self._frozen is not None

    @property
    def map(self) -> Map:
        """What there is so far: the largest part of the map, or what is joined to the one before.

        Nodes of other parts, which nothing joins to it yet, are left out.
        """
        if self._frozen is not None:
            return self._frozen
        known = self._known
        chosen = self.graph.largest_part(next(iter(known.nodes), None))
        session = max(known.sessions, default=-1) + 1
        return Map(
            {node: MapNode(node, self._odometry.nodes[node].stamp_ns,
                           known.nodes[node].session if node in known.nodes else session, T.copy())
             for node, T in chosen.items()},
            tuple(edge for edge in self.graph.edges if edge.source in chosen),
            self.keyframes.copy(chosen), self.tracker.config, self.tracker.tracker_config,
            self.mapper_config, self.T_base_sensor)

    def finish(self) -> tuple[Loop, ...]:
        """Work on all candidates that wait, however long it takes; return the loops closed."""
        closed: list[Edge] = []
        while self._closes_loops and (len(self.candidates) or len(self._verification)):
            closed += self._work(wait=True)
        return tuple(self._loop_of(edge) for edge in closed)

    def offer(self, loop: Loop) -> tuple[Loop, ...]:
        """Take a loop from elsewhere; return those that are believed now that there is one more.

        Raises
        ------
        InputError
            One of its stamps is of no keyframe.
        """
        source, target = (self._odometry.node_at(stamp_ns) for stamp_ns in (
            loop.source_stamp_ns, loop.target_stamp_ns))
        edge = Edge(target, source, loop.T_target_source, loop.covariance, Kind.LOOP)
        return tuple(self._loop_of(closed) for closed in self._offer([edge]))

    def trajectory(self, *, loops: bool = True) -> Trajectory:
        """Return the optimised pose of every scan that has one, or that by odometry alone."""
        return self._odometry.trajectory(self.graph, loops=loops)

    def node_stamps_ns(self) -> dict[int, int]:
        """Return the stamp of each node of the graph, nanoseconds."""
        return {node.id: node.stamp_ns for node in self._odometry.nodes.values()}

    def node_poses(self) -> tuple[list[int], Array]:
        """Return stamps, nanoseconds, and T_map_sensor (N, 4, 4) of nodes joined to the first."""
        part = self.graph.part(self.graph.nodes[0])
        nodes = [node for node in self.graph.nodes if self.graph.part(node) == part]
        stamps_ns = self.node_stamps_ns()
        return [stamps_ns[node] for node in nodes], self.graph.poses(nodes)

    def _add_node(self, node: Node, edge: Edge | None, prepared: PreparedScan,
                  T_map_sensor: Array) -> None:
        """Put a node into the graph, and let its candidates wait; an origin is put where it is.

        As long as it is in no part of the map that was there before, it is looked for all over it.
        """
        c = self.mapper_config
        if edge is None:
            self.graph.add_origin(node.id, T_map_sensor)
        else:
            self.graph.add_node(edge)
            self.consistency.paths.add(edge)
        if not self._closes_loops:
            return
        if not self._is_in_map(node.id):
            self._look_for(node, prepared)
        place = Surroundings(node, prepared, self.keyframes, self.graph, self.consistency.paths, c)
        targets = place.candidates(self._odometry.nodes)
        if not self._is_in_map(node.id):    # all of the map was asked already
            targets = [target for target in targets if target not in self._known.nodes]
        self.candidates.add(node.id, prepared, targets, c.waiting)
        if not self.frozen and not place.is_covered():
            self.keyframes.add(node.id, node.stamp_ns, node.track_id, prepared)

    def _look_for(self, node: Node, prepared: PreparedScan) -> None:
        """Look for a node all over the map that was there before.

        Where several places of it fit, one loop to each waits for what the next nodes say.
        """
        edges, found = self._relocalisation.look_for(node, prepared)
        self._found += self._offer(edges)
        if not self._is_in_map(node.id):
            self._notes.append(f'not found in the map: {found.reason}')

    def _look_again(self) -> None:
        """Look for the last node, now that there is a hint: the sensor may stand still."""
        reference = self.tracker.reference
        node = None if reference is None else self._odometry.nodes.get(
            reference.id + self._odometry.first)
        if (self._closes_loops and reference is not None and node is not None
                and not self._is_in_map(node.id)):
            self._look_for(node, reference.prepared)

    def _keep_deskewed(self) -> None:
        """Keep a keyframe anew whose motion was known only when the next scan came."""
        reference = self.tracker.reference
        if reference is None or reference.id + self._odometry.first not in self.keyframes:
            return
        kept = self.keyframes[reference.id + self._odometry.first]
        if kept.frame_covariance is not reference.prepared.frame_covariance:
            self.keyframes.add(kept.id, kept.stamp_ns, kept.track_id, reference.prepared)

    def _is_elsewhere(self, scan: SemanticScan) -> bool:
        """Whether a scan that the tracker cannot place is at a place of the map, and far from it.

        It has to be registered to two keyframes that agree with each other: a kidnapped sensor.
        """
        count = self.mapper_config.registrations_per_scan
        if not self._closes_loops or not len(self.keyframes):
            return False
        # how it is bent is in both registrations alike, and no reason for them to differ
        prepared = preprocess(scan, self.tracker.config)
        alike = list(dict.fromkeys([*self._hinted()[:count],
                                    *list(self.keyframes.alike(prepared))[:count]]))
        tried = [self._verification.one(Candidate(NO_NODE, prepared, target), self.keyframes,
                                        self.tracker.config) for target in alike]
        found = [edge for edge in tried if edge is not None]
        if not any(self.consistency.agree(*pair) for pair in combinations(found, 2)):
            return False
        at = self.graph.pose(found[0].target) @ found[0].T_target_source
        way = at[:3, 3] - self._odometry.last_pose(self.graph)[:3, 3]
        return float(np.linalg.norm(way)) > self.mapper_config.loop_radius * prepared.scale

    def _hinted(self) -> list[int]:
        """Return the keyframes, nearest to the hint first; none without a hint."""
        hint, nodes = self._relocalisation.hint, [one.id for one in self.keyframes]
        if hint is None:
            return []
        distance = np.linalg.norm((self.graph.poses(nodes) - hint)[:, :3, 3], axis=1)
        return [nodes[row] for row in np.argsort(distance)]

    def _work(self, *, at_once: bool = False, wait: bool = False) -> list[Edge]:
        """Register candidates, as many as there is time for; return the loops believed now."""
        found = self._verification.work(
            self.candidates, self.keyframes, self.tracker.config,
            self.mapper_config.registrations_per_scan, at_once=at_once, wait=wait)
        if self._verification.fault and self._closes_loops:
            self._closes_loops = False
            self._notes.append(self._verification.fault)
        return self._offer(found) if found else []

    def _offer(self, loops: list[Edge]) -> list[Edge]:
        """Return the loops that are believed now, closed in the graph."""
        if self.graph.missing:
            return []
        closed = [edge for loop in loops
                  for edge in self.consistency.offer(loop, self.mapper_config)]
        if closed:
            self.graph.close(closed)
        if self.consistency.in_question():
            before = {id(edge) for edge in self.graph.loops}
            kept = self.graph.without_outliers([*self.graph.loops,
                                                *self.consistency.contradicting])
            self.graph.replace_loops(kept)
            self.consistency.begin_anew(self.graph.edges)
            closed += [edge for edge in kept if id(edge) not in before]
        return closed

    def _loop_of(self, edge: Edge) -> Loop:
        nodes = self._odometry.nodes
        return Loop(nodes[edge.source].stamp_ns, nodes[edge.target].stamp_ns,
                    edge.T_target_source, edge.covariance)

    def _is_in_map(self, node: int) -> bool:
        """Whether a node is joined to the map that was there before; without one, all are."""
        return not self._known.nodes or (
            self.graph.part(node) == self.graph.part(next(iter(self._known.nodes))))

    def _T_map_odom(self, tracked: TrackedScan) -> Array | None:
        if tracked.T_odom_sensor is None:
            return None
        node = self._odometry.last(tracked.track_id)
        if not self._is_in_map(node.id):
            return None
        return self.graph.pose(node.id) @ se3.inverse(node.T_odom_sensor)
