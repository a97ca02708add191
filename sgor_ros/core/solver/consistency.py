"""Semantic-geometric consistency (Sec. III-C, Eq. 7 and 9 to 13): what is kept of each group.

The top-k of the paper reads one row of M* for each group, the seed's. Entry (l, j) of it is
m_l^T W_m m_j, with the rows of M' as vectors of 0 and 1, where m_l and M_s* let j in. Keys are worked
on in blocks of 64, one bit each: first ``support``, m_l^T W_m for all keys of the block at once,
then its sum over the ones of m_j.
"""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.lanes import load
from ..common.lanes import splat
from ..common.lanes import store
from ..common.lanes import total
from ..common.lanes import where
from ..common.threads import shared
from ..matching.correspondences import Correspondences
from ..scan.labels import labels_agree
from .graph import ConsistencyGraph
from .graph import lanes_of
from .graph import mark_row
from .graph import measure
from .graph import places_of_bits
from .graph import prefilter_limit
from .graph import U64
from .graph import weigh
from .graph import weight_table
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
    filtered = FilteredGroups(np.full((len(groups.keys), keep), -1, np.int64),
                              np.zeros((len(groups.keys), keep), np.float32))
    agreement = label_agreement(correspondences, semantics)
    words = -(-len(correspondences) // 64)
    support = np.empty((BLOCK, 64 * words), np.float32)
    for first in range(0, len(groups.keys), BLOCK):
        block = slice(first, first + BLOCK)
        keys = groups.keys[block]
        near, wanted = np.zeros((2, len(correspondences)), np.uint64)
        _mark_keys(graph.start, graph.index, correspondences.source, keys,
                   groups.squared_reach[block], *agreement, near, wanted)
        rows = np.flatnonzero(wanted)
        bits = np.zeros((len(rows), words), np.uint64)
        shared(_mark_rows, len(rows), graph.start, graph.index, rows, bits)
        asked = np.flatnonzero(np.unpackbits(np.bitwise_or.reduce(bits, axis=0).view(np.uint8),
                                             bitorder='little'))
        if graph.reach > graph.sigma_d:
            _support_afar(correspondences, graph, near, asked, support[:len(keys)])
        else:
            shared(_support, len(asked), graph.start, graph.index, graph.weight, near, asked,
                   support[:len(keys)])
        shared(_choose, len(keys), support, rows, wanted[rows], bits, filtered.kept[block],
               filtered.scores[block])
    return filtered


def _support_afar(correspondences: Correspondences, graph: ConsistencyGraph,
                  near: NDArray[np.uint64], asked: NDArray[np.intp],
                  support: NDArray[np.float32]) -> None:
    """Write the support where W_m reaches beyond the graph: weigh what is near a key anew."""
    middle = [points.mean(axis=0) for points in (correspondences.source, correspondences.target)]
    both = np.hstack((correspondences.source - middle[0], correspondences.target - middle[1]))
    some = np.flatnonzero(near)
    shared(_weigh_support, len(asked), both, both[some],
           lanes_of(both[some, :3], both[some, 3:]), prefilter_limit(graph.reach), graph.reach,
           weight_table(graph.sigma_d, graph.reach), near[some], asked, support)


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
def _support(first, last, start, index, weight, near, asked,  # type: ignore[no-untyped-def]
             support):
    """Write columns of the support of all keys, from the rows of the graph."""
    lanes = np.empty(BLOCK, np.float32)
    for r in range(U64(first), U64(last)):
        b = U64(asked[r])
        one = two = three = four = splat(np.float32(0.0))
        for e in range(start[b], start[b + U64(1)]):
            keys = near[index[e]]
            w = splat(weight[e])
            one += where(keys, w)
            two += where(keys >> U64(16), w)
            three += where(keys >> U64(32), w)
            four += where(keys >> U64(48), w)
        _write_column(one, two, three, four, lanes, b, support)


@numba.njit(cache=True, nogil=True, inline='always')
def _write_column(one, two, three, four, lanes, b, support):  # type: ignore[no-untyped-def]
    store(lanes, U64(0), one)
    store(lanes, U64(16), two)
    store(lanes, U64(32), three)
    store(lanes, U64(48), four)
    for g in range(U64(len(support))):
        support[g, b] = lanes[g]


@numba.njit(cache=True, nogil=True, error_model='numpy')
def _weigh_support(first, last, both, some, columns, limit, reach,  # type: ignore[no-untyped-def]
                   table, near, asked, support):
    """Write columns of the support of all keys from some matches, those near a key."""
    lanes = np.empty(BLOCK, np.float32)
    row = np.empty(columns.shape[1] // 64, np.uint64)
    places = np.empty(len(some), np.uint32)
    gap, other = np.empty(len(some)), np.empty(len(some))
    per_metre, last_cell = (len(table) - 1) / reach, len(table) - 2.0
    for r in range(U64(first), U64(last)):
        b = U64(asked[r])
        px, py, pz, qx, qy, qz = both[b]
        mark_row(columns, 0, np.float32(px), np.float32(py), np.float32(pz), np.float32(qx),
                 np.float32(qy), np.float32(qz), limit, row)
        found = places_of_bits(row, 0, places)
        measure(some, places, found, px, py, pz, qx, qy, qz, gap, other)
        one = two = three = four = splat(np.float32(0.0))
        for k in range(found):
            if gap[k] <= reach:
                keys = near[places[k]]
                w = splat(weigh(gap[k], per_metre, last_cell, table))
                one += where(keys, w)
                two += where(keys >> U64(16), w)
                three += where(keys >> U64(32), w)
                four += where(keys >> U64(48), w)
        _write_column(one, two, three, four, lanes, b, support)


@numba.njit(cache=True, nogil=True)
def _choose(first, last, support, rows, wanted, bits, kept, scores):  # type: ignore[no-untyped-def]
    """Sum the support of each key over the ones of each row that it may keep."""
    for g in range(U64(first), U64(last)):
        own = support[g]
        for r in range(U64(len(rows))):
            if (wanted[r] >> g) & U64(1):
                row = bits[r]
                one = two = three = four = splat(np.float32(0.0))
                for w in range(U64(len(row))):
                    word, at = row[w], w * U64(64)
                    one += where(word, load(own, at))
                    two += where(word >> U64(16), load(own, at + U64(16)))
                    three += where(word >> U64(32), load(own, at + U64(32)))
                    four += where(word >> U64(48), load(own, at + U64(48)))
                _insert(total((one + two) + (three + four)), rows[r], scores[g], kept[g])


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
