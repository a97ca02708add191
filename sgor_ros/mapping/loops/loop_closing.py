"""The way of a loop: a candidate is registered, believed or not, and closed in the pose graph."""
from collections.abc import Container
from collections.abc import Iterable
from collections.abc import Mapping
from concurrent.futures import Executor
from itertools import combinations

from ...core.config import SgorConfig
from ...core.prepared_scan import PreparedScan
from ..config import MapperConfig
from ..edge import Edge
from ..edge import NO_NODE
from ..keyframe import Keyframes
from ..odometry import Node
from ..pose_graph import PoseGraph
from .candidates import Candidate
from .candidates import Candidates
from .candidates import Surroundings
from .loop_consistency import LoopConsistency
from .verification import Verification


class LoopClosing:
    """Closes loops between the nodes of a pose graph.

    Parameters
    ----------
    graph : PoseGraph
        Loops that are believed are closed in it.
    keyframes : Keyframes
        What new nodes are registered to.
    config : MapperConfig
    executor : concurrent.futures.Executor, optional
        Where candidates are registered; without it here.

    Attributes
    ----------
    enabled : bool
        Whether loops are looked for: not without GTSAM, not with zero registrations a scan, and
        not any more where the executor broke.
    candidates : Candidates
    consistency : LoopConsistency
    warnings : list of str
        Why no loops are closed, to be told once.
    """

    def __init__(self, graph: PoseGraph, keyframes: Keyframes, config: MapperConfig,
                 executor: Executor | None = None) -> None:
        self.enabled = bool(config.registrations_per_scan and not graph.missing)
        self.candidates = Candidates()
        self.consistency = LoopConsistency()
        self.consistency.begin_anew(graph.edges)
        self._graph, self._keyframes, self._config = graph, keyframes, config
        self.warnings = [graph.missing] if graph.missing else []
        self._verification = Verification(executor)

    @property
    def pending(self) -> bool:
        """Whether candidates wait or are being registered."""
        return self.enabled and bool(len(self.candidates) or len(self._verification))

    def add_odometry(self, edge: Edge) -> None:
        """Take in an odometry edge, by which loops are judged."""
        self.consistency.paths.add(edge)

    def forget_nodes(self) -> None:
        """Forget what is known of nodes that have left the graph."""
        self.consistency.keep(self._graph, self._graph.edges)

    def add_candidates(self, node: Node, prepared: PreparedScan, nodes: Mapping[int, Node],
                       but: Container[int] = ()) -> bool:
        """Let the candidates of a new node wait; return whether its place has a keyframe already.

        Parameters
        ----------
        node : Node
        prepared : PreparedScan
        nodes : mapping of int to Node
            All nodes of the graph.
        but : container of int
            Keyframes that it has been registered to.
        """
        place = Surroundings(node, prepared, self._keyframes, self._graph, self.consistency.paths,
                             self._config)
        targets = [target for target in place.candidates(nodes) if target not in but]
        self.candidates.add(node.id, prepared, targets, self._config.waiting)
        return place.is_covered()

    def work(self, config: SgorConfig, *, at_once: bool = False, wait: bool = False
             ) -> list[Edge]:
        """Register candidates, `registrations_per_scan` at most; return the loops believed now.

        Parameters
        ----------
        config : SgorConfig
        at_once : bool
            Whether to register them here, whatever there is elsewhere.
        wait : bool
            Whether to wait for those that are registered elsewhere.
        """
        found = self._verification.work(
            self.candidates, self._keyframes, config, self._config.registrations_per_scan,
            at_once=at_once, wait=wait)
        if self._verification.fault and self.enabled:
            self.enabled = False
            self.warnings.append(self._verification.fault)
        # one that was registered elsewhere for long may have left the graph
        found = [loop for loop in found if loop.source in self._graph]
        return self.offer(found) if found else []

    def offer(self, loops: Iterable[Edge]) -> list[Edge]:
        """Return the loops that are believed now, closed in the graph."""
        if self._graph.missing:
            return []
        closed = [edge for loop in loops
                  for edge in self.consistency.offer(loop, self._config)]
        if closed:
            self._graph.close(closed)
        if self.consistency.in_question():
            before = {id(edge) for edge in self._graph.loops}
            kept = self._graph.without_outliers([*self._graph.loops,
                                                 *self.consistency.contradicting])
            self._graph.replace_loops(kept)
            self.consistency.begin_anew(self._graph.edges)
            closed += [edge for edge in kept if id(edge) not in before]
        return closed

    def recognised(self, prepared: PreparedScan, config: SgorConfig, first: list[int]
                   ) -> Edge | None:
        """Register a scan that is no node to keyframes that look alike.

        Parameters
        ----------
        prepared : PreparedScan
        config : SgorConfig
        first : list of int
            Keyframes to try before those.

        Returns
        -------
        Edge or None
            A loop to it, where two agree with each other.
        """
        count = self._config.registrations_per_scan
        targets = dict.fromkeys([*first[:count], *list(self._keyframes.alike(prepared))[:count]])
        tried = [self._verification.one(Candidate(NO_NODE, prepared, target), self._keyframes,
                                        config) for target in targets]
        found = [edge for edge in tried if edge is not None]
        agree = any(self.consistency.agree(*pair) for pair in combinations(found, 2))
        return found[0] if agree else None
