"""The way of a scan through the mapper, on one screen."""
from concurrent.futures import Executor
from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..core.prepared_scan import PreparedScan
from ..core.preprocessing import preprocess
from ..core.scan.scan import SemanticScan
from ..tracker import State
from ..tracker import TrackedScan
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .config import MapperConfig
from .edge import Edge
from .loops.loop_closing import LoopClosing
from .maps.map import Map
from .maps.relocalisation import Relocalisation
from .odometry import Node
from .result import Loop
from .result import MappedScan
from .result import Trajectory
from .session import Session

Array = NDArray[np.float64]


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
        self._session = Session(known)
        self.graph, self.keyframes = self._session.graph, self._session.keyframes
        self._loops = LoopClosing(self.graph, self.keyframes, self.mapper_config, self._executor)
        self.consistency, self.candidates = self._loops.consistency, self._loops.candidates
        self._relocalisation = Relocalisation(known)
        self.T_base_sensor = known.T_base_sensor
        self._frozen: Map | None = None
        self._found: list[Edge] = []    # loops to the map that are told of with this scan
        self._warnings: list[str] = []

    def track(self, scan: SemanticScan, stamp_ns: int) -> MappedScan:
        """Take the next scan: its pose by odometry, and the loops that it closed.

        Parameters
        ----------
        scan : SemanticScan
        stamp_ns : int
            Its stamp, nanoseconds, as of `Tracker.track`.
        """
        tracked = self.tracker.track(scan, stamp_ns)
        if tracked.state in (State.FAILED, State.LOST) and self._is_kidnapped(scan):
            self.tracker.begin_track()
            self._warnings.append('the sensor is at another place of the map: a new track begins')
        self._session.keep_deskewed(self.tracker.reference)
        if self._relocalisation.hint_is_new:
            self._relocalise_again()
        keyframe = self.tracker.reference if tracked.keyframe else None
        return self.add(tracked, None if keyframe is None else keyframe.prepared)

    def add(self, tracked: TrackedScan, prepared: PreparedScan | None) -> MappedScan:
        """Take a scan that has been tracked; prepared, where the tracker made a keyframe of it."""
        if tracked.T_odom_sensor is not None:
            added = self._session.add(tracked, self.tracker.tracker_config)
            if added is not None:
                assert prepared is not None, 'a keyframe comes with its prepared scan'
                self._add_node(*added, prepared)
                self._trim()
        # where a track begins, its place in the map is what the scan is waited for
        closed = self._loops.work(self.tracker.config, at_once=tracked.restarted)
        return self._result(tracked, closed)

    def _add_node(self, node: Node, edge: Edge | None, prepared: PreparedScan) -> None:
        """Look for loops of a new node, and keep its scan where there is no keyframe near.

        As long as it is in no part of the map that was there before, it is looked for all over it.
        """
        if edge is not None:
            self._loops.add_odometry(edge)
        if not self._loops.enabled:
            return
        if not self._session.is_in_map(node.id):
            self._relocalise(node, prepared)
        # where it is not in the map still, all of the map was asked already
        but = () if self._session.is_in_map(node.id) else self._session.known.nodes
        covered = self._loops.add_candidates(node, prepared, self._session.nodes, but)
        if not covered and not self.frozen:
            self.keyframes.add(node.id, node.stamp_ns, node.track_id, prepared)

    def _trim(self) -> None:
        """Bound what is kept of the drive as long as nothing is added to the map."""
        if self._frozen is not None and self._session.trim(self._frozen.nodes):
            self._loops.forget_nodes()

    def _relocalise(self, node: Node, prepared: PreparedScan) -> None:
        """Look for a node all over the map that was there before.

        Where several places of it fit, one loop to each waits for what the next nodes say.
        """
        edges, found = self._relocalisation.look_for(node, prepared)
        self._found += self._loops.offer(edges)
        if not self._session.is_in_map(node.id):
            self._warnings.append(f'not found in the map: {found.reason}')

    def _relocalise_again(self) -> None:
        """Look for the last node, now that there is a hint: the sensor may stand still."""
        reference = self.tracker.reference
        node = None if reference is None else self._session.nodes.get(
            self._session.node_of(reference.id))
        if (self._loops.enabled and reference is not None and node is not None
                and not self._session.is_in_map(node.id)):
            self._relocalise(node, reference.prepared)

    def _is_kidnapped(self, scan: SemanticScan) -> bool:
        """Whether a scan that the tracker cannot place is at a place of the map, and far from it.

        It has to be registered to two keyframes that agree with each other.
        """
        if not self._loops.enabled or not len(self.keyframes):
            return False
        # how it is bent is in both registrations alike, and no reason for them to differ
        prepared = preprocess(scan, self.tracker.config)
        nodes = [one.id for one in self.keyframes]
        hinted = self._relocalisation.nearest_to_hint(nodes, self.graph.poses(nodes))
        loop = self._loops.recognised(prepared, self.tracker.config, hinted)
        if loop is None:
            return False
        at = self.graph.pose(loop.target) @ loop.T_target_source
        way = at[:3, 3] - self._session.last_pose()[:3, 3]
        return float(np.linalg.norm(way)) > self.mapper_config.loop_radius * prepared.scale

    def _result(self, tracked: TrackedScan, closed: list[Edge]) -> MappedScan:
        """Return what became of a scan, and tell what has not been told yet."""
        told = {item.name: getattr(tracked, item.name) for item in fields(tracked)}
        told['warnings'] = (*tracked.warnings, *self._warnings, *self._loops.warnings)
        loops = tuple(self._session.loop_of(edge) for edge in (*self._found, *closed))
        self._found, self._warnings, self._loops.warnings = [], [], []
        hypotheses: tuple[Array, ...] = ()
        T_map_odom = self._session.T_map_odom(tracked)
        if T_map_odom is not None:
            self._relocalisation.forget_hint()
        elif tracked.T_odom_sensor is not None:
            hypotheses = self._relocalisation.hypotheses(tracked.track_id, tracked.T_odom_sensor)
        return MappedScan(**told, loops=loops, T_map_odom=T_map_odom, hypotheses=hypotheses)

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

        Until then, `map` is what it is now. Memory grows by that of `trajectory` alone: of what is
        driven meanwhile the newest 100 to 200 nodes stay in the graph, without scans, for loops
        to hold them to the map.

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
        return bool(self._session.known.nodes)

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
        return self._session.as_map(self.tracker.config, self.tracker.tracker_config,
                                    self.mapper_config, self.T_base_sensor)

    def finish(self) -> tuple[Loop, ...]:
        """Work on all candidates that wait, however long it takes; return the loops closed."""
        closed: list[Edge] = []
        while self._loops.pending:
            closed += self._loops.work(self.tracker.config, wait=True)
        return tuple(self._session.loop_of(edge) for edge in closed)

    def offer(self, loop: Loop) -> tuple[Loop, ...]:
        """Take a loop from elsewhere; return those that are believed now that there is one more.

        Raises
        ------
        InputError
            One of its stamps is of no keyframe.
        """
        closed = self._loops.offer([self._session.edge_of(loop)])
        return tuple(self._session.loop_of(edge) for edge in closed)

    def trajectory(self, *, loops: bool = True) -> Trajectory:
        """Return the optimised pose of every scan that has one, or that by odometry alone.

        112 bytes of each are kept for it. Those of a frozen mapper whose nodes have gone since
        are where they were then, with and without loops.
        """
        return self._session.trajectory(loops=loops)

    def node_stamps_ns(self) -> dict[int, int]:
        """Return the stamp of each node of the graph, nanoseconds."""
        return {node.id: node.stamp_ns for node in self._session.nodes.values()}

    def node_poses(self) -> tuple[list[int], Array]:
        """Return stamps, nanoseconds, and T_map_sensor (N, 4, 4) of nodes joined to the first."""
        nodes = list(self.graph.largest_part(self.graph.nodes[0]))
        return [self._session.nodes[node].stamp_ns for node in nodes], self.graph.poses(nodes)
