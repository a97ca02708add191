"""Semantic-geometric consistency (Sec. III-C, Eq. 7 and 9 to 13): what is kept of each group.

The top-k of the paper reads one row of M* for each group, the seed's.
"""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..matching.correspondences import Correspondences
from ..scan.labels import labels_agree
from .graph import ConsistencyGraph
from .grouping import Groups
from .grouping import squared_distance
from .lengths import U64
from .seed_rows import add_support
from .seed_rows import BLOCK
from .seed_rows import Block
from .seed_rows import blocks_of
from .seed_rows import choose
from .seed_rows import far_rows


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
    support = np.empty((BLOCK, -(-n // 64) * 64), np.float32)
    far = far_rows(correspondences, graph, count)
    for places in blocks_of(correspondences.source[groups.keys], np.arange(count)):
        near, wanted = np.zeros((2, n), np.uint64)
        keys = groups.keys[places]
        visits = _mark_keys(graph.start, graph.index, correspondences.source, keys,
                            groups.squared_reach[places], *agreement, near, wanted)
        block = Block(near, wanted, np.flatnonzero(wanted), visits)
        add_support(correspondences, graph, far, block, keys, support)
        choose(graph, block, support, places, filtered.kept, filtered.scores)
    return filtered


@numba.njit(cache=True, nogil=True)
def _mark_keys(start, index, points, keys, squared_reach, tight,
               loose, near, wanted):
    """Set bit g of `near` for what is consistent with key g; of `wanted` if it may be kept.

    Return how long the rows of all that is near are together.
    """
    visits = U64(0)
    for g in range(U64(len(keys))):
        key = keys[g]
        bit = U64(1) << g
        x, y, z = points[key]
        for k in range(start[key], start[key + U64(1)]):
            j = U64(index[k])
            near[j] |= bit
            visits += start[j + U64(1)] - start[j]
            # M_s is the outer product of these with themselves (Eq. 9 to 11)
            if ((tight[key] and tight[j]) or (loose[key] and loose[j])) and squared_distance(
                    points[j, 0], points[j, 1], points[j, 2], x, y, z) <= squared_reach[g]:
                wanted[j] |= bit
    return visits
