"""Correspondence grouping: keys by spectral matching, kNN groups (Sec. III-B)."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from .config import SgorConfig
from .correspondences import Correspondences
from .graph import ConsistencyGraph

POWER_ITERATIONS = 10
"""As PointDSC; the order of the keys has settled by then."""
MOST_VISITS, FEWEST_GROUPS = 1e8, 20
"""Edges to visit for all seed rows, some tenths of a second; and the groups that remain."""


@dataclass(frozen=True, eq=False)
class Groups:
    """L groups of k correspondences.

    Attributes
    ----------
    keys : (L,) int64
        Key correspondences G^k, the strongest first; fewer than asked for in a dense graph.
    members : (L, k) int64
        Correspondences nearest to each key on the source, the key among them, in no order.
    """

    keys: NDArray[np.int64]
    members: NDArray[np.int64]


def group(correspondences: Correspondences, graph: ConsistencyGraph,
          config: SgorConfig) -> Groups:
    """Choose keys by spectral matching and gather the k nearest correspondences of each."""
    score = leading_eigenvector(graph)
    order = np.argsort(-score, kind='stable')
    keys = _spread(correspondences.source, order, min(config.groups, len(order)),
                   config.key_spacing)
    # where most matches are right, rows are long and few groups do
    visits = np.cumsum((graph.inner - graph.start[:-1])[keys].astype(np.float64)**2)
    keys = keys[:max(int(np.searchsorted(visits, MOST_VISITS)), FEWEST_GROUPS)]
    k = min(config.group_size, len(correspondences))
    return Groups(keys, _nearest(correspondences.source, keys, k))


def leading_eigenvector(graph: ConsistencyGraph) -> NDArray[np.float32]:
    """Return the leading eigenvector of the consistent weights: spectral matching's confidence.

    Returns
    -------
    (N,) float32
        Not negative, length one.
    """
    vector = np.ones(len(graph.inner), np.float32)
    for _ in range(POWER_ITERATIONS):
        vector = _multiply(graph.start, graph.inner, graph.index, graph.weight, vector)
        vector /= np.linalg.norm(vector)
    return vector


@numba.njit(cache=True, nogil=True, parallel=True, fastmath=True)
def _multiply(start, inner, index, weight, vector):  # type: ignore[no-untyped-def]
    product = np.empty_like(vector)
    for i in numba.prange(len(vector)):
        total = np.float32(0.0)
        for e in range(start[i], inner[i]):
            total += weight[e] * vector[index[e]]
        product[i] = total
    return product


@numba.njit(cache=True, nogil=True)
def _spread(points, order, count, spacing):  # type: ignore[no-untyped-def]
    """Take the strongest first, passing over those near a taken one; then fill up with those."""
    taken = np.empty(count, np.int64)
    passed = np.empty(len(order), np.int64)
    n_taken = 0
    n_passed = 0
    limit = spacing * spacing
    for i in order:
        near = False
        for t in range(n_taken):
            a = points[i, 0] - points[taken[t], 0]
            b = points[i, 1] - points[taken[t], 1]
            c = points[i, 2] - points[taken[t], 2]
            if a * a + b * b + c * c < limit:
                near = True
                break
        if near:
            passed[n_passed] = i
            n_passed += 1
        else:
            taken[n_taken] = i
            n_taken += 1
            if n_taken == count:
                break
    for k in range(count - n_taken):
        taken[n_taken + k] = passed[k]
    return taken


@numba.njit(cache=True, nogil=True, parallel=True)
def _nearest(points, keys, k):  # type: ignore[no-untyped-def]
    """Return the k nearest points of each key, (L, k): for large k faster than a tree."""
    n = len(points)
    members = np.empty((len(keys), k), np.int64)
    for g in numba.prange(len(keys)):
        x, y, z = points[keys[g]]
        squared = np.empty(n)
        for i in range(n):
            squared[i] = ((points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2
                          + (points[i, 2] - z) ** 2)
        limit = _kth_smallest(squared, k)
        found = 0
        for i in range(n):
            if squared[i] < limit:
                members[g, found] = i
                found += 1
        for i in range(n):    # those at the limit share the places that are left
            if found == k:
                break
            if squared[i] == limit:
                members[g, found] = i
                found += 1
    return members


@numba.njit(cache=True, nogil=True)
def _kth_smallest(values, k):  # type: ignore[no-untyped-def]
    """Select by a histogram first, so that only one bin of it is sorted."""
    top = values.max()
    if top == 0:
        return top
    scale = 255.0 / top
    count = np.zeros(256, np.int64)
    for v in values:
        count[int(v * scale)] += 1
    before, at = 0, 0
    while before + count[at] < k:
        before += count[at]
        at += 1
    inside = np.empty(count[at])
    n = 0
    for v in values:
        if int(v * scale) == at:
            inside[n] = v
            n += 1
    return np.sort(inside)[k - before - 1]
