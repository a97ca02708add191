"""Semantic-geometric consistency (Sec. III-C, Eq. 7 and 9 to 13): what is kept of each group.

The top-k of the paper reads one row of M* for each group, the seed's: it is summed along the
edges of the consistency graph.
"""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.threads import shared
from ..matching.correspondences import Correspondences
from ..scan.labels import labels_agree
from .graph import ConsistencyGraph
from .grouping import Groups
from .grouping import squared_distance


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
    shared(_filter, len(groups.keys), graph.start, graph.inner, graph.index, graph.weight,
           correspondences.source, groups.keys, groups.squared_reach,
           *label_agreement(correspondences, semantics), filtered.kept, filtered.scores)
    return filtered


@numba.njit(cache=True, nogil=True)
def _filter(first, last, start, inner, index, weight, points, keys,
            squared_reach, tight, loose, kept, scores):
    support = np.empty(len(inner), np.float32)
    for g in range(first, last):
        key = keys[g]
        support[:] = 0    # row of M'_g W_m
        for k in range(start[key], inner[key]):
            a = index[k]
            for e in range(start[a], start[a + 1]):
                support[index[e]] += weight[e]
        x, y, z = points[key]
        for k in range(start[key], inner[key]):
            j = index[k]
            if squared_distance(points[j, 0], points[j, 1], points[j, 2], x, y, z
                                ) > squared_reach[g]:
                continue
            # M_s is the outer product of these with themselves (Eq. 9 to 11)
            if not ((tight[key] and tight[j]) or (loose[key] and loose[j])):
                continue
            total = np.float32(0.0)
            for e in range(start[j], inner[j]):
                total += support[index[e]]
            _insert(total, j, scores[g], kept[g])


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
