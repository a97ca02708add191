"""The pose graph, in GTSAM: incremental (iSAM2), one connected part a track until loops join them.

Errors of edges are as everywhere in this package, position and rotation each by itself in the
target frame; GTSAM has rotation first, both in the frame of the source. See docs/pose_graph.md.
"""
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from .edge import Edge

Array = NDArray[np.float64]

ORIGIN_SIGMA = 1e-4
"""Metres and radians: the first node of a part stays where it is put."""
RELINEARISE = 0.01
"""Metres and radians: nodes that have moved by more are linearised again."""
ROUNDS = 3
"""Updates after a loop; the estimate has settled then."""


class PoseGraph:
    """Nodes with poses in the map, and the edges between them.

    Attributes
    ----------
    edges : list of Edge
        In the order that they came in.
    poses : dict of int to (4, 4) float64
        T_map_sensor of each node, optimised.
    """

    def __init__(self) -> None:
        self._gtsam = library()
        self.edges: list[Edge] = []
        self.poses: dict[int, Array] = {}
        self._part: dict[int, int] = {}
        self._solver = self._new_solver()

    def part(self, node: int) -> int:
        """Return the first node of the part that a node is in."""
        while self._part[node] != node:
            self._part[node] = self._part[self._part[node]]
            node = self._part[node]
        return node

    def add_origin(self, node: int, T_map_sensor: Array) -> None:
        """Begin a part of its own."""
        self._part[node] = node
        self.poses[node] = T_map_sensor
        self._update([self._prior(node)], [node])

    def add_node(self, edge: Edge) -> None:
        """Add the source of an edge, whose target is there already."""
        self.edges.append(edge)
        self._part[edge.source] = self.part(edge.target)
        self.poses[edge.source] = self.poses[edge.target] @ edge.T_target_source
        self._update([self._factor(edge)], [edge.source])

    def close(self, loops: Iterable[Edge]) -> None:
        """Add edges between nodes that are there, and optimise. They may join parts."""
        loops = list(loops)
        joined = False
        for loop in loops:
            self.edges.append(loop)
            joined |= self._join(loop)
        if joined:    # nodes were moved, which iSAM2 cannot take in
            self._solver = self._new_solver()
            self._update([self._prior(node) for node in self._part if self._part[node] == node]
                         + [self._factor(edge) for edge in self.edges], list(self.poses))
        else:
            self._update([self._factor(loop) for loop in loops], [])
        for _ in range(ROUNDS - 1):
            self._solver.update()
        self._read(self._solver.calculateBestEstimate())

    def replace_loops(self, loops: Iterable[Edge]) -> None:
        """Forget all loops, and close these in their place."""
        raise NotImplementedError

    def chi_squared(self) -> tuple[float, int]:
        """Return the sum of squared errors in standard deviations, and the degrees of freedom."""
        factors = self._gtsam.NonlinearFactorGraph()
        for edge in self.edges:
            factors.add(self._factor(edge))
        parts = sum(self._part[node] == node for node in self._part)
        return (2 * factors.error(self._values(self.poses)),
                6 * (len(self.edges) - len(self.poses) + parts))

    def _join(self, loop: Edge) -> bool:
        """Move one of two parts to where a loop has it; the later one, for maps begin early."""
        first, second = self.part(loop.target), self.part(loop.source)
        if first == second:
            return False
        if second < first:
            loop = loop.reversed()
            first, second = second, first
        move = (self.poses[loop.target] @ loop.T_target_source
                @ se3.inverse(self.poses[loop.source]))
        for node in self._part:
            if self.part(node) == second:
                self.poses[node] = move @ self.poses[node]
        self._part[second] = first
        return True

    def _new_solver(self) -> Any:
        parameters = self._gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(RELINEARISE)
        parameters.relinearizeSkip = 1
        return self._gtsam.ISAM2(parameters)

    def _update(self, factors: Iterable[Any], nodes: Iterable[int]) -> None:
        graph = self._gtsam.NonlinearFactorGraph()
        for factor in factors:
            graph.add(factor)
        self._solver.update(graph, self._values({node: self.poses[node] for node in nodes}))

    def _values(self, poses: dict[int, Array]) -> Any:
        values = self._gtsam.Values()
        for node, T in poses.items():
            values.insert(node, self._gtsam.Pose3(T))
        return values

    def _read(self, values: Any) -> None:
        rows = self._gtsam.utilities.extractPose3(values)    # by keys, row-major R and t
        for node, row in zip(sorted(self.poses), rows, strict=True):
            self.poses[node] = se3.compose(row[:9].reshape(3, 3), row[9:])

    def _prior(self, node: int) -> Any:
        return self._gtsam.PriorFactorPose3(
            node, self._gtsam.Pose3(self.poses[node]),
            self._gtsam.noiseModel.Isotropic.Sigma(6, ORIGIN_SIGMA))

    def _factor(self, edge: Edge) -> Any:
        turn = np.kron([[0, 1], [1, 0]], edge.T_target_source[:3, :3].T)
        noise = self._gtsam.noiseModel.Gaussian.Covariance(turn @ edge.covariance @ turn.T)
        return self._gtsam.BetweenFactorPose3(
            edge.target, edge.source, self._gtsam.Pose3(edge.T_target_source), noise)


def library() -> Any:
    """Return GTSAM, which is an extra of the package.

    Raises
    ------
    ImportError
        It is not installed, or does not work with the numpy that is.
    """
    import gtsam
    return gtsam


