"""How two nodes lie to each other by the edges that are believed, along the surest way."""
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from .edge import chained
from .edge import Edge

Array = NDArray[np.float64]

LEVER_M = 20.0
"""What turns are weighed with when ways are compared: so far on they matter."""


class Paths:
    """The edges as a network, whose lengths are variances."""

    def __init__(self) -> None:
        self._row: dict[int, int] = {}
        self._edges: dict[tuple[int, int], Edge] = {}
        self._network: csr_array | None = None
        self._from: tuple[int, Array, Array] | None = None

    def add(self, edge: Edge) -> None:
        """Take one more edge; of two between the same nodes the surer one stays."""
        a, b = (self._row.setdefault(node, len(self._row)) for node in (edge.target, edge.source))
        if (a, b) not in self._edges or _variance(edge) < _variance(self._edges[a, b]):
            self._edges[a, b] = edge
            self._edges[b, a] = edge.reversed()
        self._network = self._from = None

    def sigmas(self, node: int) -> dict[int, float]:
        """Return the standard deviation of the position of all nodes seen from one, metres.

        Roughly: turns count with one lever. Nodes that no way leads to are left out.
        """
        variances, _ = self._search(node)
        return {other: float(np.sqrt(variances[row])) for other, row in self._row.items()
                if np.isfinite(variances[row])}

    def between(self, target: int, source: int) -> tuple[Array, Array] | None:
        """Return T_target_source with its covariance; None where no way leads there."""
        variances, before = self._search(source)
        if target not in self._row or not np.isfinite(variances[self._row[target]]):
            return None
        row, edges = self._row[target], []
        while before[row] >= 0:
            edges.append(self._edges[row, int(before[row])])
            row = int(before[row])
        return chained(edges)

    def _search(self, node: int) -> tuple[Array, Array]:
        """Return the variance of the surest way from a node to each, and the one before each."""
        if self._from is not None and self._from[0] == node:
            return self._from[1:]
        count = len(self._row)
        if node not in self._row:
            return np.full(count, np.inf), np.full(count, -1)
        if self._network is None:
            ends = np.array(list(self._edges), np.int64)
            lengths = [_variance(edge) for edge in self._edges.values()]
            self._network = csr_array((lengths, (ends[:, 0], ends[:, 1])), (count, count))
        variances, before = dijkstra(self._network, indices=self._row[node],
                                     return_predecessors=True)
        self._from = node, variances, before
        return variances, before


def _variance(edge: Edge) -> float:
    return float(np.trace(edge.covariance[:3, :3]) + LEVER_M**2 * np.trace(edge.covariance[3:, 3:]))
