"""How two nodes lie to each other by the edges that are believed, along the surest way."""
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..edge import chained
from ..edge import Edge

Array = NDArray[np.float64]

LEVER_M = 20.0
"""What turns are weighed with when ways are compared: so far on they matter."""


class Paths:
    """The edges as a network, whose lengths are variances."""

    def __init__(self) -> None:
        self._row: dict[int, int] = {}
        self._edges: dict[tuple[int, int], Edge] = {}
        # in the order of _edges: rows of both ends, and variances
        self._ends: tuple[list[int], list[int]] = ([], [])
        self._variances: list[float] = []
        self._place: dict[tuple[int, int], int] = {}
        self._network: csr_array | None = None
        self._from: tuple[int, Array, Array] | None = None

    def add(self, edge: Edge) -> None:
        """Take one more edge; of two between the same nodes the surer one stays."""
        a, b = (self._row.setdefault(node, len(self._row)) for node in (edge.target, edge.source))
        self._put(a, b, edge)
        self._put(b, a, edge.reversed())
        self._network = self._from = None

    def _put(self, a: int, b: int, edge: Edge) -> None:
        variance = _variance(edge)
        place = self._place.setdefault((a, b), len(self._variances))
        if place == len(self._variances):
            self._ends[0].append(a)
            self._ends[1].append(b)
            self._variances.append(variance)
        elif self._variances[place] <= variance:
            return
        self._variances[place] = variance
        self._edges[a, b] = edge

    def sigmas(self, node: int, others: Sequence[int]) -> Array:
        """Return the standard deviation of the position of others seen from a node, metres.

        Roughly: turns count with one lever. Infinite where no way leads.
        """
        variances, _ = self._search(node)
        return np.sqrt([variances[self._row[other]] if other in self._row else np.inf
                        for other in others])

    def between(self, target: int, source: int) -> tuple[Array, Array] | None:
        """Return T_target_source with its covariance; None where no way leads there."""
        edges = self.way(target, source)
        return None if edges is None else chained(edges)

    def way(self, target: int, source: int) -> list[Edge] | None:
        """Return the edges of that way, end to end from the target; None where there is none."""
        variances, before = self._search(source)
        if target not in self._row or not np.isfinite(variances[self._row[target]]):
            return None
        row, edges = self._row[target], []
        while before[row] >= 0:
            edges.append(self._edges[row, int(before[row])])
            row = int(before[row])
        return edges

    def _search(self, node: int) -> tuple[Array, Array]:
        """Return the variance of the surest way from a node to each, and the one before each."""
        if self._from is not None and self._from[0] == node:
            return self._from[1:]
        count = len(self._row)
        if node not in self._row:
            return np.full(count, np.inf), np.full(count, -1)
        if self._network is None:
            self._network = csr_array((self._variances, self._ends), (count, count))
        variances, before = dijkstra(self._network, indices=self._row[node],
                                     return_predecessors=True)
        self._from = node, variances, before
        return variances, before


def _variance(edge: Edge) -> float:
    of_position, of_rotation = edge.covariance[:3, :3], edge.covariance[3:, 3:]
    return float(of_position.trace() + LEVER_M**2 * of_rotation.trace())
