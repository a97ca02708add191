"""Semantic-geometric consistency (Sec. III-C, Eq. 7 and 9 to 13): what is kept of each group.

The top-k of the paper reads one row of M* for each group, the seed's. Entry (l, j) of it is
m_l^T W_m m_j, with the rows of M' as vectors of 0 and 1, where m_l and M_s* let j in. Keys are worked
on in blocks of 64, one bit each: first ``support``, m_l^T W_m for all keys of the block at once,
then its sum over the ones of m_j.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.lanes import add_where
from ..common.lanes import load
from ..common.lanes import splat
from ..common.lanes import store
from ..common.lanes import total
from ..common.threads import shared
from ..matching.correspondences import Correspondences
from ..scan.labels import labels_agree
from .graph import ConsistencyGraph
from .graph import lanes_of
from .graph import mark_row
from .graph import places_of_bits
from .graph import prefilter_limit
from .graph import U64
from .graph import weigh
from .grouping import Groups
from .grouping import squared_distance

BLOCK = 64
"""Keys of which each has a bit of a word, and a lane of four vectors."""


@dataclass(frozen=True, eq=False)
class FilteredGroups:
    """G'_l: the correspondences that are kept of each group, best first (Eq. 13).

    Attributes
    ----------
    kept : (L, k1) int64
        -1 where fewer are consistent with the key.
    scores : (L, k1) float32
        Their entries of row l of M*; 0 where there is none.
    """

    kept: NDArray[np.int64]
    scores: NDArray[np.float32]


def label_agreement(correspondences: Correspondences,
                    semantics: str) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which correspondences agree in point labels and in regional labels, both (N,)."""
    c = correspondences
    if semantics == 'none':
        return np.ones(len(c), np.bool_), np.ones(len(c), np.bool_)
    tight = labels_agree(c.source_labels, c.target_labels)
    if semantics == 'hard':
        return tight, np.zeros(len(c), np.bool_)
    return tight, labels_agree(c.source_regional, c.target_regional)


def filter_groups(correspondences: Correspondences, graph: ConsistencyGraph, groups: Groups,
                  keep: int, semantics: str) -> FilteredGroups:
    """Keep the best of each group by row l of M* = M_s* o M_g o (M'_g W_m M'_g^T) (Eq. 7 to 13).

    Parameters
    ----------
    correspondences : Correspondences
    graph : ConsistencyGraph
        Of these correspondences.
    groups : Groups
    keep : int
        k_1, at most so many of each group.
    semantics : {'loose', 'hard', 'none'}
        See `SgorConfig`.
    """
    count, n = len(groups.keys), len(correspondences)
    filtered = FilteredGroups(np.full((count, keep), -1, np.int64),
                              np.zeros((count, keep), np.float32))
    agreement = label_agreement(correspondences, semantics)
    words = -(-n // 64)
    support = np.empty((BLOCK, 64 * words), np.float32)
    for block in _neighbouring(correspondences.source[groups.keys], np.arange(count)):
        near, wanted = np.zeros((2, n), np.uint64)
        _mark_keys(graph.start, graph.index, correspondences.source, groups.keys[block],
                   groups.squared_reach[block], *agreement, near, wanted)
        rows = np.flatnonzero(wanted)
        bits = np.zeros((len(rows), words), np.uint64)
        shared(_mark_rows, len(rows), graph.start, graph.index, rows, bits)
        if graph.reach > graph.sigma_d:
            _support_afar(correspondences, graph, near, rows, wanted[rows], support)
        else:
            shared(_support, 4 * words, graph.start, graph.index, graph.weight,
                   near.view(np.uint16), np.bitwise_or.reduce(bits, axis=0).view(np.uint16),
                   support)
        shared(_choose, len(block), support, rows, wanted[rows], bits.view(np.uint16), block,
               filtered.kept, filtered.scores)
    return filtered


def _neighbouring(points: NDArray[np.float64], keys: NDArray[np.intp]
                  ) -> Iterator[NDArray[np.intp]]:
    """Divide the keys into blocks of neighbours, for these share what is consistent with them."""
    if len(keys) <= BLOCK:
        yield keys
        return
    axis = np.ptp(points[keys], axis=0).argmax()
    order = keys[np.argsort(points[keys, axis], kind='stable')]
    half = BLOCK * -(-len(keys) // (2 * BLOCK))
    yield from _neighbouring(points, order[:half])
    yield from _neighbouring(points, order[half:])


def _support_afar(correspondences: Correspondences, graph: ConsistencyGraph,
                  near: NDArray[np.uint64], rows: NDArray[np.intp], wanted: NDArray[np.uint64],
                  support: NDArray[np.float32]) -> None:
    """Write the support where W_m reaches beyond the graph: weigh what is near a key anew."""
    p, q = correspondences.source, correspondences.target
    both = np.hstack((p - p.mean(axis=0), q - q.mean(axis=0)))
    some = np.flatnonzero(near)
    asked = np.zeros(-(-len(p) // 16) * 16, np.uint64)
    _mark_asked(graph.start, graph.index, rows, wanted, asked)
    shared(_weigh_support, len(asked) // 16, both, both[some],
           lanes_of(both[some, :3], both[some, 3:]), prefilter_limit(graph.reach), graph.sigma_d,
           graph.reach, near[some], asked, support)


@numba.njit(cache=True, nogil=True)
def _mark_keys(start, index, points, keys, squared_reach, tight,  # type: ignore[no-untyped-def]
               loose, near, wanted):
    """Set bit g of `near` for what is consistent with key g; of `wanted` if it may be kept."""
    for g in range(U64(len(keys))):
        key = keys[g]
        bit = U64(1) << g
        x, y, z = points[key]
        for k in range(start[key], start[key + U64(1)]):
            j = index[k]
            near[j] |= bit
            # M_s is the outer product of these with themselves (Eq. 9 to 11)
            if ((tight[key] and tight[j]) or (loose[key] and loose[j])) and squared_distance(
                    points[j, 0], points[j, 1], points[j, 2], x, y, z) <= squared_reach[g]:
                wanted[j] |= bit


@numba.njit(cache=True, nogil=True)
def _mark_rows(first, last, start, index, rows, bits):  # type: ignore[no-untyped-def]
    """Write rows of M' as bits."""
    for r in range(U64(first), U64(last)):
        row = bits[r]
        i = U64(rows[r])
        for k in range(start[i], start[i + U64(1)]):
            j = U64(index[k])
            row[j >> U64(6)] |= U64(1) << (j & U64(63))


@numba.njit(cache=True, nogil=True)
def _mark_asked(start, index, rows, wanted, asked):  # type: ignore[no-untyped-def]
    """Set bit g where a row that key g may keep has a one: nothing else of its support counts."""
    for r in range(U64(len(rows))):
        i, keys = U64(rows[r]), wanted[r]
        for k in range(start[i], start[i + U64(1)]):
            asked[index[k]] |= keys


@numba.njit(cache=True, nogil=True)
def _support(first, last, start, index, weight, near, asked,  # type: ignore[no-untyped-def]
             support):
    """Write columns of the support of all keys, sixteen a task, from the rows of the graph."""
    square = np.empty((16, BLOCK), np.float32)
    for part in range(U64(first), U64(last)):
        wanted = asked[part]
        for c in range(U64(16)):
            if not (wanted >> c) & 1:
                continue
            b = U64(16) * part + c
            one = two = three = four = splat(np.float32(0.0))
            for e in range(start[b], start[b + U64(1)]):
                at, w = U64(4) * U64(index[e]), splat(weight[e])
                one = add_where(near[at], one, w)
                two = add_where(near[at + U64(1)], two, w)
                three = add_where(near[at + U64(2)], three, w)
                four = add_where(near[at + U64(3)], four, w)
            _put(square[c], one, two, three, four)
        if wanted:
            _transpose(square, U64(16) * part, support)


@numba.njit(cache=True, nogil=True, inline='always')
def _put(lanes, one, two, three, four):  # type: ignore[no-untyped-def]
    store(lanes, U64(0), one)
    store(lanes, U64(16), two)
    store(lanes, U64(32), three)
    store(lanes, U64(48), four)


@numba.njit(cache=True, nogil=True)
def _transpose(square, at, support):  # type: ignore[no-untyped-def]
    """Write sixteen columns at once: one by one each element would touch a line of the cache."""
    for g in range(U64(BLOCK)):
        for c in range(U64(16)):
            support[g, at + c] = square[c, g]


@numba.njit(cache=True, nogil=True)
def _weigh_support(first, last, both, some, columns, limit, sigma_d,  # type: ignore[no-untyped-def]
                   reach, near, asked, support):
    """Write columns of the support of all keys, from all matches near one of these."""
    square = np.empty((16, BLOCK), np.float32)
    lanes = near.view(np.uint16)
    row = np.empty(columns.shape[1] // 64, np.uint64)
    places = np.empty(len(some), np.uint32)
    squared, other = np.empty(len(some)), np.empty(len(some))
    weight = np.empty(len(some), np.float32)
    for part in range(U64(first), U64(last)):
        for c in range(U64(16)):
            b = U64(16) * part + c
            if not asked[b]:
                continue
            px, py, pz, qx, qy, qz = both[b]
            mark_row(columns, 0, np.float32(px), np.float32(py), np.float32(pz), np.float32(qx),
                     np.float32(qy), np.float32(qz), limit, row)
            found = U64(0)
            for k in range(places_of_bits(row, 0, places)):
                # only what is near a key that asks here
                places[found] = places[k]
                found += U64((near[places[k]] & asked[b]) != 0)
            weigh(some, places, found, px, py, pz, qx, qy, qz, sigma_d, reach, squared, other,
                  weight)
            one = two = three = four = splat(np.float32(0.0))
            for k in range(found):
                at, w = U64(4) * U64(places[k]), splat(weight[k])
                one = add_where(lanes[at], one, w)
                two = add_where(lanes[at + U64(1)], two, w)
                three = add_where(lanes[at + U64(2)], three, w)
                four = add_where(lanes[at + U64(3)], four, w)
            _put(square[c], one, two, three, four)
        _transpose(square, U64(16) * part, support)


@numba.njit(cache=True, nogil=True)
def _choose(first, last, support, rows, wanted, bits, block, kept,  # type: ignore[no-untyped-def]
            scores):
    """Sum the support of each key over the ones of each row that it may keep."""
    for g in range(U64(first), U64(last)):
        own = support[g]
        for r in range(U64(len(rows))):
            if (wanted[r] >> g) & U64(1):
                row = bits[r]
                one = two = three = four = splat(np.float32(0.0))
                for part in range(U64(0), U64(len(row)), U64(4)):
                    at = U64(16) * part
                    one = add_where(row[part], one, load(own, at))
                    two = add_where(row[part + U64(1)], two, load(own, at + U64(16)))
                    three = add_where(row[part + U64(2)], three, load(own, at + U64(32)))
                    four = add_where(row[part + U64(3)], four, load(own, at + U64(48)))
                _insert(total((one + two) + (three + four)), rows[r], scores[block[g]],
                        kept[block[g]])


@numba.njit(cache=True, nogil=True)
def _insert(score, item, scores, items):  # type: ignore[no-untyped-def]
    """Put an item into its place among the best; the worst drops out."""
    at = len(scores) - 1
    if score <= scores[at]:
        return
    while at > 0 and scores[at - 1] < score:
        scores[at], items[at] = scores[at - 1], items[at - 1]
        at -= 1
    scores[at], items[at] = score, item
