"""Correspondence grouping: keys by spectral matching, kNN groups (Sec. III-B)."""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..config import SgorConfig
from ..execution.threads import parallel_for
from ..matching.correspondences import Correspondences
from .graph import ConsistencyGraph
from .lengths import U64

POWER_ITERATIONS = 10
"""As PointDSC; the order of the keys has settled by then."""
MOST_VISITS, FEWEST_GROUPS = 1e8, 20
"""Edges to visit for all seed rows, some tenths of a second; and the groups that remain."""


@dataclass(frozen=True, eq=False)
class Groups:
    """L groups of k correspondences.

    Attributes
    ----------
    keys : (L,) uint32
        Key correspondences G^k, the strongest first; fewer than asked for in a dense graph.
    squared_reach : (L,) float64
        A group is all correspondences with a squared distance on the source up to this from the
        key, m^2: the k nearest, itself the first, and what is as far as the last of them.
    """

    keys: NDArray[np.uint32]
    squared_reach: NDArray[np.float64]


def group(correspondences: Correspondences, graph: ConsistencyGraph,
          config: SgorConfig) -> Groups:
    """Choose keys by spectral matching and find how far the k nearest of each reach."""
    score = leading_eigenvector(graph)
    order = np.argsort(-score, kind='stable')
    keys = _spread(correspondences.source, order, min(config.groups, len(order)),
                   config.key_spacing)
    # where most matches are right, rows are long and few groups do
    visits = np.cumsum(np.diff(graph.start)[keys].astype(np.float64)**2)
    keys = keys[:max(int(np.searchsorted(visits, MOST_VISITS)), FEWEST_GROUPS)]
    k = min(config.group_size, len(correspondences))
    reach = np.empty(len(keys))
    # no two are farther apart
    most = 1e-9 + 1.001 * float((np.ptp(correspondences.source, axis=0)**2).sum())
    parallel_for(_squared_reach, len(keys), np.ascontiguousarray(correspondences.source.T), keys,
                 k, most, reach)
    return Groups(keys, reach)


def leading_eigenvector(graph: ConsistencyGraph) -> NDArray[np.float32]:
    """Return the leading eigenvector of the consistent weights: spectral matching's confidence.

    Returns
    -------
    (N,) float32
        Not negative, length one.
    """
    vector = np.ones(len(graph.start) - 1, np.float32)
    product = np.empty_like(vector)
    for _ in range(POWER_ITERATIONS):
        parallel_for(_multiply, len(vector), graph.start, graph.index, graph.weight, vector,
                     product)
        vector, product = product / math.sqrt(
            np.einsum('i,i', product, product, dtype=np.float64)), vector
    return vector


@numba.njit(cache=True, nogil=True, fastmath=True)
def _multiply(first, last, start, index, weight, vector, product):
    for i in range(U64(first), U64(last)):
        # four sums, so that an addition need not wait for the one before
        a = b = c = d = np.float32(0.0)
        e, end = start[i], start[i + U64(1)]
        while e + U64(4) <= end:
            a += weight[e] * vector[index[e]]
            b += weight[e + U64(1)] * vector[index[e + U64(1)]]
            c += weight[e + U64(2)] * vector[index[e + U64(2)]]
            d += weight[e + U64(3)] * vector[index[e + U64(3)]]
            e += U64(4)
        while e < end:
            a += weight[e] * vector[index[e]]
            e += U64(1)
        product[i] = (a + b) + (c + d)


@numba.njit(cache=True, nogil=True)
def _spread(points, order, count, spacing):
    """Take the strongest first, passing over those near a taken one; then fill up with those."""
    taken = np.empty(count, np.uint32)
    passed = np.empty(len(order), np.uint32)
    n_taken = 0
    n_passed = 0
    limit = spacing * spacing
    for i in order:
        near = False
        for t in range(n_taken):
            k = taken[t]
            if squared_distance(points[i, 0], points[i, 1], points[i, 2],
                                points[k, 0], points[k, 1], points[k, 2]) < limit:
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


@numba.njit(cache=True, nogil=True)
def _squared_reach(first, last, columns, keys, k, most, reach):
    """Write how far the k nearest of each key reach: for large k faster than a tree."""
    n = columns.shape[1]
    squared = np.empty(n)
    for g in range(U64(first), U64(last)):
        x, y, z = columns[:, keys[g]]
        for i in range(n):
            squared[i] = squared_distance(columns[0, i], columns[1, i], columns[2, i], x, y, z)
        reach[g] = _bound_of_nearest(squared, k, most)


@numba.njit(cache=True, nogil=True, inline='always')
def squared_distance(ax, ay, az, bx, by, bz):
    """Return the squared distance of two points; whoever asks for members rounds alike."""
    return (ax - bx) * (ax - bx) + (ay - by) * (ay - by) + (az - bz) * (az - bz)


@numba.njit(cache=True, nogil=True)
def _bound_of_nearest(squared, k, most):
    """Narrow the range up to `most` until k values are within; vectors count fast."""
    low, high = 0.0, most
    below, within = _count_within(squared, low), len(squared)
    if below >= k:
        return low
    halve = False
    while within != k:
        # where it should be if all were evenly spread, and every second time in the middle
        share = 0.5 if halve else (k - below + 0.5) / (within - below + 1.0)
        middle = low + share * (high - low)
        if middle <= low or middle >= high:
            if halve:    # several at the same distance
                break
            halve = True
            continue
        halve = not halve
        count = _count_within(squared, middle)
        if count < k:
            low, below = middle, count
        else:
            high, within = middle, count
    return high


@numba.njit(cache=True, nogil=True)
def _count_within(values, bound):
    count = 0
    for i in range(len(values)):
        count += values[i] <= bound
    return count
