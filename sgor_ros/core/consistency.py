"""Semantic-geometric consistency (Sec. III-C, Eq. 7 and 9 to 12): the seed rows of M*.

The top-k of the paper reads one row of M* for each group, the seed's: they are summed along the
edges of the consistency graph.
"""
import numba
import numpy as np
from numpy.typing import NDArray

from .correspondences import Correspondences
from .graph import ConsistencyGraph
from .grouping import Groups


def label_agreement(correspondences: Correspondences,
                    semantics: str) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which correspondences agree in point labels and in regional labels, both (N,)."""
    c = correspondences
    if semantics == 'none':
        return np.ones(len(c), np.bool_), np.ones(len(c), np.bool_)
    tight = c.source_labels == c.target_labels
    if semantics == 'hard':
        return tight, np.zeros(len(c), np.bool_)
    return tight, c.source_regional == c.target_regional


def seed_rows(graph: ConsistencyGraph, groups: Groups, tight: NDArray[np.bool_],
              loose: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return row l of M* = M_s* o M_g o (M'_g W_m M'_g^T) for each group (Eq. 7 to 12).

    Parameters
    ----------
    graph : ConsistencyGraph
    groups : Groups
        Keys (L,) and members (L, k).
    tight, loose : (N,) bool
        Whether a correspondence has the same point label, and the same regional label, at both
        ends: M_s is their outer product with themselves (Eq. 9 and 10).

    Returns
    -------
    (L, k) float32
    """
    rows = np.zeros(groups.members.shape, np.float32)
    _seed_rows(graph.start, graph.inner, graph.index, graph.weight, groups.keys, groups.members,
               tight, loose, rows)
    return rows


@numba.njit(cache=True, nogil=True, parallel=True)
def _seed_rows(start, inner, index, weight, keys, members, tight,  # type: ignore[no-untyped-def]
               loose, rows):
    for g in numba.prange(len(keys)):
        key = keys[g]
        support = np.zeros(len(inner), np.float32)     # row of M'_g W_m
        consistent = np.zeros(len(inner), np.bool_)    # row of M'_g
        for k in range(start[key], inner[key]):
            a = index[k]
            consistent[a] = True
            for e in range(start[a], start[a + 1]):
                support[index[e]] += weight[e]
        for m in range(members.shape[1]):
            j = members[g, m]
            if j < 0 or not consistent[j]:
                continue
            if not ((tight[key] and tight[j]) or (loose[key] and loose[j])):
                continue
            total = np.float32(0.0)
            for e in range(start[j], inner[j]):
                total += support[index[e]]
            rows[g, m] = total
