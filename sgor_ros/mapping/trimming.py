"""Trims the pose graph: old nodes go, and the ways that led through them become edges."""
from collections.abc import Collection
from collections.abc import Container
from collections.abc import Iterator

import numpy as np
from scipy.cluster.hierarchy import DisjointSet

from ..core.common import se3
from .edge import chained
from .edge import Edge
from .edge import Kind
from .loops.paths import Paths
from .pose_graph import PoseGraph

NEWEST = 100
"""Nodes of the drive that stay; of twice as many the older half goes."""


def too_many(graph: PoseGraph, stay: Collection[int]) -> list[int]:
    """Return the nodes that are to go: none until there are twice `NEWEST` besides some."""
    others = [node for node in graph.nodes if node not in stay]
    return others[:-NEWEST] if len(others) > 2 * NEWEST else []


def edges_without(graph: PoseGraph, going: Container[int]) -> list[Edge]:
    """Return the edges of a graph of which some nodes go.

    Nodes that only those joined are joined by edges anew, each along the surest way through them,
    as few as it takes. No edge that stays is part of such a way: nothing counts twice.
    """
    lost = [edge for edge in graph.edges if edge.source in going or edge.target in going]
    kept = [edge for edge in graph.edges if not (edge.source in going or edge.target in going)]
    order = {node: i for i, node in enumerate(graph.nodes)}
    joined = DisjointSet(order)
    for edge in kept:
        joined.merge(edge.target, edge.source)
    ends = {end for edge in lost for end in (edge.target, edge.source) if end not in going}
    kept += _bridges(graph, lost, sorted(ends, key=order.__getitem__), joined)
    return sorted(kept, key=lambda edge: order[edge.source])


def _bridges(graph: PoseGraph, lost: list[Edge], ends: list[int], joined: DisjointSet
             ) -> Iterator[Edge]:
    """Yield edges between `ends`, in the order of the graph, that only lost ones join."""
    paths = Paths()
    for edge in lost:
        paths.add(edge)
    for i, node in enumerate(ends):
        others = [other for other in ends[:i] if not joined.connected(node, other)]
        sigmas = paths.sigmas(node, others)
        for k in np.argsort(sigmas).tolist():
            way = paths.way(others[k], node)
            if way is not None and joined.merge(node, others[k]):
                T_other_node = se3.inverse(graph.pose(others[k])) @ graph.pose(node)
                kind = Kind.LOOP if any(edge.kind is Kind.LOOP for edge in way) else Kind.ODOMETRY
                yield Edge(others[k], node, T_other_node, chained(way)[1], kind)
