"""Seed rows of M* (Eq. 7): entry (l, j) is m_l^T W_m m_j, the rows of M' as vectors of 0 and 1.

Keys are worked on in blocks of 64, one bit of a word each: first the support, m_l^T W_m for all
keys of the block at once, each column of it one pass over a row of W_m; then, for each key, its
sum over the ones of each m_j that the key may keep.
"""
from collections.abc import Iterator
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ..execution.threads import parallel_for
from ..matching.correspondences import Correspondences
from .graph import ConsistencyGraph
from .graph import pairs_within
from .graph import Rows
from .lengths import columns_of
from .lengths import mark_row
from .lengths import places_of_bits
from .lengths import prefilter_limit
from .lengths import U64
from .lengths import weigh

BLOCK = 64
"""Keys of which each has a bit of a word."""
SPARSE = 6
"""Single additions that take as long as one to the sums of all 64 keys."""
FEW_BLOCKS, MOST_MATCHES = 4, 12_000
"""With more blocks W_m beyond sigma_d is weighed once; of more matches it would be too large."""


class Block(NamedTuple):
    """Some keys, and a bit of a word for each.

    Attributes
    ----------
    near : (N,) uint64
        Bit g: consistent with key g.
    wanted : (N,) uint64
        Bit g: and key g may keep it.
    rows : (R,) int64
        What any key may keep.
    visits : int
        Length of the rows that are near a key, of all keys.
    """

    near: NDArray[np.uint64]
    wanted: NDArray[np.uint64]
    rows: NDArray[np.intp]
    visits: int


def blocks_of(points: NDArray[np.float64], keys: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Divide keys at (L, 3) points into blocks of neighbours: much is consistent with them all."""
    if len(keys) <= BLOCK:
        yield keys
        return
    axis = np.ptp(points[keys], axis=0).argmax()
    order = keys[np.argsort(points[keys, axis], kind='stable')]
    half = BLOCK * -(-len(keys) // (2 * BLOCK))
    yield from blocks_of(points, order[:half])
    yield from blocks_of(points, order[half:])


def far_rows(correspondences: Correspondences, graph: ConsistencyGraph, keys: int) -> Rows | None:
    """Return W_m, where it has rows to add up: of the graph, or of all pairs within its reach.

    None where it costs less, or less memory, to weigh anew what is near a key for each block.
    """
    if graph.reach <= graph.sigma_d:
        return graph
    if keys <= FEW_BLOCKS * BLOCK or len(correspondences) > MOST_MATCHES:
        return None
    return pairs_within(correspondences, graph.sigma_d, graph.reach)


def add_support(correspondences: Correspondences, graph: ConsistencyGraph, far: Rows | None,
                block: Block, keys: NDArray[np.uint32], support: NDArray[np.float32]) -> None:
    """Write m_l^T W_m for the keys of a block, (64, N), at least where they ask for it."""
    near = block.near
    tasks = support.shape[1] // 16
    if far is None:
        p, q = correspondences.source, correspondences.target
        both = np.hstack((p - p.mean(axis=0), q - q.mean(axis=0)))
        some = np.flatnonzero(near)
        parallel_for(_support_afar, tasks, graph.start, graph.index, both, both[some],
                     columns_of(both[some, :3], both[some, 3:]), prefilter_limit(graph.reach),
                     graph.sigma_d, graph.reach, near[some], _spread(near[some]), block.wanted,
                     support)
    elif block.visits < SPARSE * len(graph.index):
        parallel_for(_scatter, len(keys), graph.start, graph.index, far.start, far.index,
                     far.weight, keys, support)
    else:
        parallel_for(_support, tasks, far.start, far.index, far.weight, _spread(near),
                     support)


def choose(graph: ConsistencyGraph, block: Block, support: NDArray[np.float32],
           places: NDArray[np.intp], kept: NDArray[np.int64], scores: NDArray[np.float32]) -> None:
    """Sum the support of each key over the ones of what it may keep; leave the best in its row."""
    parallel_for(_choose, len(places), graph.start, graph.index, support, block.rows,
                 block.wanted[block.rows], places, kept, scores)


@numba.njit(cache=True, nogil=True)
def _asking(start, index, wanted, b):
    """Return the keys for which a row that they may keep has a one at b."""
    keys = U64(0)
    for e in range(start[b], start[b + U64(1)]):
        keys |= wanted[index[e]]
    return keys


@numba.njit(cache=True, nogil=True)
def _scatter(first, last, start, index, far_start, far_index, weight,
             keys, support):
    """Write the support of each key from the rows that are near it: faster where keys have few."""
    for g in range(U64(first), U64(last)):
        own = support[g]
        own[:] = 0
        for k in range(start[keys[g]], start[keys[g] + U64(1)]):
            a = U64(index[k])
            for e in range(far_start[a], far_start[a + U64(1)]):
                own[far_index[e]] += weight[e]


@numba.njit(cache=True, nogil=True)
def _support(first, last, start, index, weight, ones, support):
    """Write sixteen columns a task, from the rows of the graph."""
    n = U64(len(start)) - U64(1)
    square = np.zeros((16, BLOCK), np.float32)
    for part in range(U64(first), U64(last)):
        for b in range(U64(16) * part, min(U64(16) * part + U64(16), n)):
            row = slice(start[b], start[b + U64(1)])
            _add(ones, index[row], weight[row], row.stop - row.start, square[b - U64(16) * part])
        _transpose(square, U64(16) * part, support)


@numba.njit(cache=True, nogil=True)
def _support_afar(first, last, start, index, both, some, columns,
                  limit, sigma_d, reach, near, ones, wanted, support):
    """Write sixteen columns a task, from what is near a key: `some`, `near` and its `ones`."""
    square = np.zeros((16, BLOCK), np.float32)
    row = np.empty(columns.shape[1] // 64, np.uint64)
    flags = np.empty(columns.shape[1], np.uint8)
    places, weights = np.empty(len(some) + 1, np.uint32), np.empty(len(some), np.float32)
    squared, other = np.empty(len(some)), np.empty(len(some))
    for part in range(U64(first), U64(last)):
        for b in range(U64(16) * part, min(U64(16) * part + U64(16), U64(len(both)))):
            keys = _asking(start, index, wanted, b)
            if keys:
                px, py, pz, qx, qy, qz = both[b]
                mark_row(columns, 0, np.float32(px), np.float32(py), np.float32(pz),
                         np.float32(qx), np.float32(qy), np.float32(qz), limit, flags, row)
                found = U64(0)
                for k in range(places_of_bits(row, 0, places)):
                    j = places[k]
                    places[found] = j
                    found += U64((near[j] & keys) != U64(0))
                weigh(some, places, found, px, py, pz, qx, qy, qz, sigma_d, reach, squared, other,
                      weights)
                _add(ones, places, weights, found, square[b - U64(16) * part])
        _transpose(square, U64(16) * part, support)


@numba.njit(cache=True, nogil=True)
def _spread(words):
    """Return the bits of words as ones and zeros, (N, 64) float32."""
    ones = np.empty((len(words), BLOCK), np.float32)
    for i in range(U64(len(words))):
        for g in range(U64(BLOCK)):
            ones[i, g] = np.float32((words[i] >> g) & U64(1))
    return ones


@numba.njit(cache=True, nogil=True, fastmath={'contract', 'nsz'})
def _add(ones, places, weights, count, sums):
    """Write the sum of the weights at places for each key that these are near."""
    sums[:] = 0
    twos = U64(count) & ~U64(1)
    for k in range(U64(0), twos, U64(2)):
        # two at once: half as often to memory and back
        near, other = ones[U64(places[k])], ones[U64(places[k + U64(1)])]
        w, v = weights[k], weights[k + U64(1)]
        for g in range(U64(BLOCK)):
            sums[g] = sums[g] + w * near[g] + v * other[g]
    if twos < U64(count):
        near, w = ones[U64(places[twos])], weights[twos]
        for g in range(U64(BLOCK)):
            sums[g] += w * near[g]


@numba.njit(cache=True, nogil=True)
def _transpose(square, at, support):
    """Write sixteen columns at once: one by one each element would touch a line of the cache."""
    for g in range(U64(BLOCK)):
        for c in range(U64(16)):
            support[g, at + c] = square[c, g]


@numba.njit(cache=True, nogil=True)
def _choose(first, last, start, index, support, rows, wanted, places, kept, scores):
    for g in range(U64(first), U64(last)):
        sums = support[g]
        best, items = scores[places[g]], kept[places[g]]
        for r in range(U64(len(rows))):
            if (wanted[r] >> g) & U64(1):
                i = U64(rows[r])
                _insert(_sum(sums, index[start[i]:start[i + U64(1)]]), rows[r], best, items)


@numba.njit(cache=True, nogil=True, fastmath={'reassoc', 'nsz'})
def _sum(values, places):
    """Return the sum of values at some places, in four sums that do not wait for each other."""
    a = b = c = d = np.float32(0.0)
    whole = U64(len(places)) & ~U64(3)
    for k in range(U64(0), whole, U64(4)):
        a += values[places[k]]
        b += values[places[k + U64(1)]]
        c += values[places[k + U64(2)]]
        d += values[places[k + U64(3)]]
    for k in range(whole, U64(len(places))):
        a += values[places[k]]
    return (a + b) + (c + d)


@numba.njit(cache=True, nogil=True)
def _insert(score, item, scores, items):
    """Put an item into its place among the best; the worst drops out."""
    at = len(scores) - 1
    if score <= scores[at]:
        return
    while at > 0 and scores[at - 1] < score:
        scores[at], items[at] = scores[at - 1], items[at - 1]
        at -= 1
    scores[at], items[at] = score, item
