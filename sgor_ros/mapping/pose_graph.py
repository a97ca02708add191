"""The pose graph, in GTSAM: incremental (iSAM2), one connected part a track until loops join them.

Errors of edges are as everywhere in this package, position and rotation each by itself in the
target frame; GTSAM has rotation first, both in the frame of the source. See docs/pose_graph.md.
"""
from collections import Counter
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from .edge import Edge
from .edge import Kind

Array = NDArray[np.float64]

ORIGIN_SIGMA = 1e-4
"""Metres and radians: the first node of a part stays where it is put."""
RELINEARISE = (0.02, 5.0)
"""Radians and metres: nodes that have turned or moved by more are linearised again. Edges are
straight in the positions, so that these hardly matter."""
INLIER_PROBABILITY = 0.997
"""Share of right loops that GNC is to keep."""
AT_THE_BOUND = 0.25
"""Weight that Geman and McClure's loss leaves an edge whose error is at the bound of inliers."""
INSTALL = "pip install 'sgor_ros[mapping]'"
ROUNDS = 10
"""Updates after a loop at most: it ends when no node has to be linearised again."""
SYMBOL = 'x'


class PoseGraph:
    """Nodes with poses in the map, and the edges between them.

    Without GTSAM nothing is optimised: poses are those of odometry, and loops are refused.

    Attributes
    ----------
    edges : list of Edge
        In the order that they came in.
    missing : str
        Why there is no GTSAM; empty where there is.
    """

    def __init__(self) -> None:
        self.missing = ''
        self._gtsam: Any = None
        try:
            self._gtsam = library()
        except ImportError as error:
            self.missing = f'loops are not closed: GTSAM is not installed ({error}); {INSTALL}'
        self._clear()

    def _clear(self) -> None:
        self.edges: list[Edge] = []
        self._row: dict[int, int] = {}
        self._poses = np.empty((0, 4, 4))
        self._parent: list[int] = []
        self._solver: Any = None
        self._new: list[int] = []    # nodes that the solver has not got yet, with their edges
        self._new_edges: list[Edge] = []

    def __len__(self) -> int:
        return len(self._row)

    def __contains__(self, node: object) -> bool:
        return node in self._row

    @property
    def nodes(self) -> list[int]:
        """All nodes, in the order that they came in."""
        return list(self._row)

    @property
    def loops(self) -> list[Edge]:
        """The edges that are loops."""
        return [edge for edge in self.edges if edge.kind is Kind.LOOP]

    def pose(self, node: int) -> Array:
        """Return T_map_sensor of a node, (4, 4)."""
        T_map_sensor: Array = self._poses[self._row[node]]
        return T_map_sensor

    def poses(self, nodes: Sequence[int]) -> Array:
        """Return T_map_sensor of some nodes, (N, 4, 4)."""
        return self._poses[[self._row[node] for node in nodes]]

    def poses_by_odometry(self, nodes: Sequence[int]) -> Array:
        """Return T_map_sensor of some nodes without loops, (N, 4, 4)."""
        return self._by_odometry()[[self._row[node] for node in nodes]]

    def part(self, node: int) -> int:
        """Return the number of the connected part that a node is in."""
        row = self._row[node]
        while self._parent[row] != row:
            row = self._parent[row]
        self._parent[self._row[node]] = row
        return row

    def largest_part(self, of: int | None = None) -> dict[int, Array]:
        """Return nodes with their poses: of the part with the most, or of that which one is in."""
        parts = [self.part(node) for node in (self.nodes if of is None else [of])]
        part = next((part for part, _ in Counter(parts).most_common(1)), None)
        return {node: self.pose(node) for node in self.nodes if self.part(node) == part}

    def add_origin(self, node: int, T_map_sensor: Array) -> None:
        """Begin a part of its own with a node at a pose."""
        self._append(node, T_map_sensor, len(self._row))

    def add_map(self, poses: Mapping[int, Array], edges: Iterable[Edge]) -> None:
        """Add nodes that were optimised before, (4, 4) each, with the edges that join them."""
        for node, T_map_sensor in poses.items():
            self._append(node, T_map_sensor, len(self._row))
        for edge in edges:
            parts = self.part(edge.source), self.part(edge.target)
            self._parent[max(parts)] = min(parts)
            self.edges.append(edge)
            self._new_edges.append(edge)

    def add_node(self, edge: Edge) -> None:
        """Add the source of an edge, whose target is there already."""
        self.edges.append(edge)
        self._new_edges.append(edge)
        self._append(edge.source, self.pose(edge.target) @ edge.T_target_source,
                     self.part(edge.target))

    def keep(self, nodes: Iterable[int], edges: Iterable[Edge]) -> None:
        """Keep some nodes where they are, joined by these edges, and forget all others."""
        poses = {node: self.pose(node) for node in nodes}
        self._clear()
        self.add_map(poses, edges)

    def close(self, loops: Sequence[Edge]) -> None:
        """Add edges between nodes that are there, and optimise. They may join parts."""
        joined = [self._join(loop) for loop in loops]    # all of them, whatever the first says
        self.edges += loops
        self._new_edges += loops
        if any(joined):    # nodes were moved, which iSAM2 cannot take in
            self._solver = None
        self._optimise()

    def without_outliers(self, loops: Sequence[Edge]) -> list[Edge]:
        """Return those of some loops that hold together, by graduated non-convexity (GNC).

        It takes seconds in a graph of thousands of nodes. Odometry counts as right.
        """
        steps = [edge for edge in self.edges if edge.kind is Kind.ODOMETRY]
        origins = [self._prior(node) for node in self._origins()]
        graph = self._gtsam.NonlinearFactorGraph()
        for factor in (*origins, *(self._factor(edge) for edge in (*steps, *loops))):
            graph.add(factor)
        parameters = self._gtsam.GncLMParams()
        # with known inliers its other loss, TLS, rejects all others
        parameters.setLossType(self._gtsam.GncLossType.GM)
        certain = len(origins) + len(steps)
        parameters.setKnownInliers(list(range(certain)))
        start, self._poses = self._poses, self._by_odometry()
        solver = self._gtsam.GncLMOptimizer(graph, self._values(self.nodes), parameters)
        self._poses = start
        solver.setInlierCostThresholdsAtProbability(INLIER_PROBABILITY)
        solver.optimize()
        weights = solver.getWeights()[certain:]
        return [loop for loop, weight in zip(loops, weights, strict=True)
                if weight > AT_THE_BOUND]

    def replace_loops(self, loops: Sequence[Edge]) -> None:
        """Take some loops in place of those that are there, and optimise."""
        self.edges = [edge for edge in self.edges if edge.kind is Kind.ODOMETRY]
        self._poses = self._by_odometry()
        self.edges += loops
        self._solver = None
        self._optimise()

    def chi_squared(self) -> tuple[float, int]:
        """Return the sum of squared errors in standard deviations, and the degrees of freedom."""
        factors = self._gtsam.NonlinearFactorGraph()
        for edge in self.edges:
            factors.add(self._factor(edge))
        return (2 * factors.error(self._values(self.nodes)),
                6 * (len(self.edges) - len(self) + len(self._origins())))

    def _append(self, node: int, T_map_sensor: Array, part: int) -> None:
        row = self._row[node] = len(self._row)
        self._new.append(node)
        self._parent.append(part)
        if row == len(self._poses):
            grown = np.empty((max(64, 2 * row), 4, 4))
            grown[:row] = self._poses
            self._poses = grown
        self._poses[row] = T_map_sensor

    def _origins(self) -> list[int]:
        """Return the first node of each part."""
        return [node for node, row in self._row.items() if self._parent[row] == row]

    def _join(self, loop: Edge) -> bool:
        """Move one of two parts to where a loop has it; the later one, for maps begin early."""
        first, second = self.part(loop.target), self.part(loop.source)
        if first == second:
            return False
        if second < first:
            loop = loop.reversed()
            first, second = second, first
        move = self.pose(loop.target) @ loop.T_target_source @ se3.inverse(self.pose(loop.source))
        rows = [row for node, row in self._row.items() if self.part(node) == second]
        self._poses[rows] = move @ self._poses[rows]
        self._parent[second] = first
        return True

    def _by_odometry(self) -> Array:
        """Return the poses without loops, from where an optimiser finds its way."""
        poses = self._poses.copy()
        for edge in self.edges:
            if edge.kind is Kind.ODOMETRY:
                poses[self._row[edge.source]] = (poses[self._row[edge.target]]
                                                 @ edge.T_target_source)
        return poses

    def _optimise(self) -> None:
        """Give the solver what is new, and take the poses from it."""
        if self._solver is None:
            self._solver = self._new_solver()
            self._new, self._new_edges = self.nodes, self.edges
        graph = self._gtsam.NonlinearFactorGraph()
        for node in self._new:
            if self._parent[self._row[node]] == self._row[node]:
                graph.add(self._prior(node))
        for edge in self._new_edges:
            graph.add(self._factor(edge))
        done = self._solver.update(graph, self._values(self._new))
        self._new, self._new_edges = [], []
        for _ in range(ROUNDS - 1):
            if not done.getVariablesRelinearized():
                break
            done = self._solver.update()
        # sorted by node: R row by row, then t
        rows = self._gtsam.utilities.extractPose3(self._solver.calculateEstimate())
        at = [self._row[node] for node in sorted(self._row)]
        self._poses[at, :3, :3] = rows[:, :9].reshape(-1, 3, 3)
        self._poses[at, :3, 3] = rows[:, 9:]

    def _new_solver(self) -> Any:
        turned, moved = RELINEARISE
        thresholds = self._gtsam.ISAM2ThresholdMap()
        thresholds.insert((SYMBOL, np.array([turned] * 3 + [moved] * 3)))
        parameters = self._gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(thresholds)
        parameters.relinearizeSkip = 1
        return self._gtsam.ISAM2(parameters)

    def _key(self, node: int) -> int:
        return int(self._gtsam.symbol(SYMBOL, node))

    def _values(self, nodes: Iterable[int]) -> Any:
        values = self._gtsam.Values()
        for node in nodes:
            values.insert(self._key(node), self._gtsam.Pose3(self.pose(node)))
        return values

    def _prior(self, node: int) -> Any:
        return self._gtsam.PriorFactorPose3(
            self._key(node), self._gtsam.Pose3(self.pose(node)),
            self._gtsam.noiseModel.Isotropic.Sigma(6, ORIGIN_SIGMA))

    def _factor(self, edge: Edge) -> Any:
        turn = np.kron([[0, 1], [1, 0]], edge.T_target_source[:3, :3].T)
        noise = self._gtsam.noiseModel.Gaussian.Covariance(turn @ edge.covariance @ turn.T)
        return self._gtsam.BetweenFactorPose3(
            self._key(edge.target), self._key(edge.source),
            self._gtsam.Pose3(edge.T_target_source), noise)


def library() -> Any:
    """Return GTSAM, which is an extra of the package.

    Raises
    ------
    ImportError
        It is not installed, or does not work with the numpy that is.
    """
    import gtsam
    return gtsam


