"""Semantic-geometric consistency (Sec. III-C): the sparse graph and the seed rows of M*.

Only 1 to 3 % of the pairs of correspondences are consistent, and the top-k of the paper reads
one row of M* for each group, the seed's. So nothing here is N x N: the graph keeps the pairs
that count, and the rows are summed along its edges.
"""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from .config import SgorConfig
from .correspondences import Correspondences
from .grouping import Groups

PREFILTER_SLACK = 1e-3
"""Metres: float32 finds the candidate pairs, float64 decides; errors stay far below this."""


@dataclass(frozen=True, eq=False)
class ConsistencyGraph:
    """Pairs of correspondences with d_ij up to `weight_cutoff` sigma_d, as compressed rows.

    Row i is ``index[start[i]:start[i + 1]]``; its first part, up to ``inner[i]``, holds the
    consistent ones (d_ij <= sigma_d: M'_g, Eq. 6), i itself first.

    Attributes
    ----------
    start : (N + 1,) int64
    inner : (N,) int64
    index : (E,) int32
    weight : (E,) float32
        W_m of each pair (Eq. 8).
    """

    start: NDArray[np.int64]
    inner: NDArray[np.int64]
    index: NDArray[np.int32]
    weight: NDArray[np.float32]


def consistency_graph(correspondences: Correspondences, config: SgorConfig) -> ConsistencyGraph:
    """Compare all pairs of correspondences by length (Eq. 5, 6 and 8)."""
    p, q = correspondences.source, correspondences.target
    n = len(p)
    reach = config.sigma_d * config.weight_cutoff
    columns = np.ascontiguousarray(np.hstack((p - p.mean(axis=0), q - q.mean(axis=0))).T,
                                   np.float32)
    upper = np.zeros(n + 1, np.int64)
    _count_pairs(columns, np.float32(reach + PREFILTER_SLACK), upper)
    np.cumsum(upper, out=upper)
    index = np.empty(upper[-1], np.int32)
    _list_pairs(columns, np.float32(reach + PREFILTER_SLACK), upper, index)
    gap = np.empty(upper[-1], np.float32)
    degree = _exact_gaps(p, q, upper, index, config.sigma_d, reach, gap)
    return _symmetric(upper, index, gap, degree, config.sigma_d)


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


@numba.njit(cache=True, nogil=True, inline='always')
def _near(columns, i, j, reach):  # type: ignore[no-untyped-def]
    """Whether | |p_i - p_j| - |q_i - q_j| | <= reach, without a square root."""
    a = columns[0, j] - columns[0, i]
    b = columns[1, j] - columns[1, i]
    c = columns[2, j] - columns[2, i]
    p = a * a + b * b + c * c
    a = columns[3, j] - columns[3, i]
    b = columns[4, j] - columns[4, i]
    c = columns[5, j] - columns[5, i]
    q = a * a + b * b + c * c
    r = reach * reach
    s = p + q
    # (a^2 - b^2)^2 = x (2 s - x) with x = (a - b)^2 grows with x up to x = s
    return ((p - q) * (p - q) <= r * (s + s - r)) | (s <= r)


@numba.njit(cache=True, nogil=True, parallel=True)
def _count_pairs(columns, reach, upper):  # type: ignore[no-untyped-def]
    n = columns.shape[1]
    # row i beside row n - 1 - i: every pair of rows costs the same
    for half in numba.prange((n + 1) // 2):
        for side in range(2):
            i = np.int64(half) if side == 0 else n - 1 - np.int64(half)
            if side == 1 and i == np.int64(half):
                continue
            found = np.int32(0)
            for j in range(i + 1, n):
                found += np.int32(_near(columns, i, j, reach))
            upper[i + 1] = found


@numba.njit(cache=True, nogil=True, parallel=True)
def _list_pairs(columns, reach, upper, index):  # type: ignore[no-untyped-def]
    n = columns.shape[1]
    for half in numba.prange((n + 1) // 2):
        near = np.zeros(n + 8, np.uint8)
        words = near[:n // 8 * 8 + 8].view(np.uint64)
        for side in range(2):
            i = np.int64(half) if side == 0 else n - 1 - np.int64(half)
            if side == 1 and i == np.int64(half):
                continue
            for j in range(i + 1, n):
                near[j] = _near(columns, i, j, reach)
            near[:i + 1] = 0
            at = upper[i]
            for word in range((i + 1) // 8, len(words)):
                if words[word] != 0:
                    for j in range(8 * word, 8 * word + 8):
                        if near[j]:
                            index[at] = j
                            at += 1


@numba.njit(cache=True, nogil=True, parallel=True)
def _exact_gaps(p, q, upper, index, sigma_d, reach, gap):  # type: ignore[no-untyped-def]
    """Write d_ij, minus d_ij beyond sigma_d, infinite beyond `reach`; return the row sizes."""
    n = len(p)
    kept = np.zeros(n, np.int64)
    for i in numba.prange(n):
        for k in range(upper[i], upper[i + 1]):
            j = index[k]
            a = np.sqrt((p[i, 0] - p[j, 0]) ** 2 + (p[i, 1] - p[j, 1]) ** 2
                        + (p[i, 2] - p[j, 2]) ** 2)
            b = np.sqrt((q[i, 0] - q[j, 0]) ** 2 + (q[i, 1] - q[j, 1]) ** 2
                        + (q[i, 2] - q[j, 2]) ** 2)
            d = abs(a - b)
            gap[k] = d if d <= sigma_d else -d if d <= reach else np.inf
    for i in range(n):
        for k in range(upper[i], upper[i + 1]):
            if gap[k] < np.inf:
                kept[i] += 1
                kept[index[k]] += 1
    return kept


def _symmetric(upper: NDArray[np.int64], index: NDArray[np.int32], gap: NDArray[np.float32],
               degree: NDArray[np.int64], sigma_d: float) -> ConsistencyGraph:
    start = np.zeros(len(degree) + 1, np.int64)
    np.cumsum(degree + 1, out=start[1:])
    inner = np.empty(len(degree), np.int64)
    full = np.empty(start[-1], np.int32)
    weight = np.empty(start[-1], np.float32)
    _mirror(upper, index, gap, np.float32(sigma_d), start, inner, full, weight)
    return ConsistencyGraph(start, inner, full, weight)


@numba.njit(cache=True, nogil=True)
def _mirror(upper, index, gap, sigma_d, start, inner, full, weight):  # type: ignore[no-untyped-def]
    """Write each pair into both of its rows: consistent ones from the front, others behind."""
    n = len(inner)
    end = start[1:].copy()
    for i in range(n):
        full[start[i]] = i
        weight[start[i]] = 1.0
        inner[i] = start[i] + 1
    scale = np.float32(-0.5) / (sigma_d * sigma_d)
    for i in range(n):
        for k in range(upper[i], upper[i + 1]):
            d = gap[k]
            if d == np.inf:
                continue
            j = index[k]
            w = np.exp(scale * d * d)
            if d >= 0:
                full[inner[i]] = j
                weight[inner[i]] = w
                inner[i] += 1
                full[inner[j]] = i
                weight[inner[j]] = w
                inner[j] += 1
            else:
                end[i] -= 1
                full[end[i]] = j
                weight[end[i]] = w
                end[j] -= 1
                full[end[j]] = i
                weight[end[j]] = w


@numba.njit(cache=True, nogil=True, parallel=True)
def _seed_rows(start, inner, index, weight, keys, members, tight, loose,
               rows):  # type: ignore[no-untyped-def]
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
