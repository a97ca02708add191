"""Geometric consistency of all pairs of correspondences as a sparse graph (Sec. III-C).

Only 1 to 3 % of the pairs are consistent, so nothing here is N x N but one bit a pair.
"""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from .config import SgorConfig
from .correspondences import Correspondences

PREFILTER_SLACK = 1e-3
"""Metres: float32 finds the candidate pairs, float64 decides. In a scan of 100 m the former errs
by some 1e-5."""


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
    bits = np.empty((n, n // 8 + 1), np.uint8)
    upper = np.zeros(n + 1, np.int64)
    _mark_pairs(columns, np.float32((reach + PREFILTER_SLACK)**2), bits, upper)
    np.cumsum(upper, out=upper)
    index = np.empty(upper[-1], np.int32)
    weight = np.empty(upper[-1], np.float32)
    degree = _weigh_pairs(p, q, bits, config.sigma_d, reach, upper, index, weight)
    start = np.zeros(n + 1, np.int64)
    np.cumsum(degree + 1, out=start[1:])
    inner = np.empty(n, np.int64)
    full_index = np.empty(start[-1], np.int32)
    full_weight = np.empty(start[-1], np.float32)
    _mirror(upper, index, weight, start, inner, full_index, full_weight)
    return ConsistencyGraph(start, inner, full_index, full_weight)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _mark_row(columns, i, limit, near):  # type: ignore[no-untyped-def]
    """Write whether (|p_i - p_j| - |q_i - q_j|)^2 <= limit for all j > i, without a square root.

    Slices from i + 1 on, and not an index that starts there, let the compiler use vectors.
    """
    px, py, pz, qx, qy, qz = columns[:, i]
    ax, ay, az = columns[0, i + 1:], columns[1, i + 1:], columns[2, i + 1:]
    bx, by, bz = columns[3, i + 1:], columns[4, i + 1:], columns[5, i + 1:]
    for j in range(len(ax)):
        x, y, z = ax[j] - px, ay[j] - py, az[j] - pz
        p = x * x + y * y + z * z
        x, y, z = bx[j] - qx, by[j] - qy, bz[j] - qz
        q = x * x + y * y + z * z
        s = p + q
        # (a^2 - b^2)^2 = d (2 s - d) with d = (a - b)^2 grows with d up to d = s
        near[j] = np.uint8(((p - q) * (p - q) <= limit * (s + s - limit)) | (s <= limit))


@numba.njit(cache=True, nogil=True, parallel=True)
def _mark_pairs(columns, limit, bits, upper):  # type: ignore[no-untyped-def]
    """Set bit j - i - 1 of row i for each candidate pair; count them into upper[i + 1]."""
    n = columns.shape[1]
    gather = np.uint64(0x0102040810204080)    # eight bytes of 0 or 1 to eight bits
    add = np.uint64(0x0101010101010101)
    for task in numba.prange((n + 1) // 2):
        half = np.int64(task)
        near = np.zeros(n // 8 * 8 + 8, np.uint8)
        words = near.view(np.uint64)
        # row i beside row n - 1 - i: all tasks cost the same
        for i in ((half, n - 1 - half) if half != n - 1 - half else (half, half)):
            _mark_row(columns, i, limit, near)
            near[n - 1 - i:] = 0
            found = np.int64(0)
            for w in range((n - 1 - i) // 8 + 1):
                bits[i, w] = (words[w] * gather) >> np.uint64(56)
                found += np.int64((words[w] * add) >> np.uint64(56))
            upper[i + 1] = found


@numba.njit(cache=True, nogil=True, parallel=True)
def _weigh_pairs(p, q, bits, sigma_d, reach, upper, index,  # type: ignore[no-untyped-def]
                 weight):
    """Write W_m of each candidate pair, negative beyond sigma_d, 0 beyond `reach`.

    Returns the pairs of each correspondence, (N,).
    """
    n = len(p)
    for i in numba.prange(n):
        at = upper[i]
        for w in range((n - 1 - np.int64(i)) // 8 + 1):
            if bits[i, w]:
                for b in range(8):
                    if (bits[i, w] >> b) & 1:
                        j = np.int64(i) + 1 + 8 * w + b
                        index[at] = j
                        d = abs(np.sqrt((p[i, 0] - p[j, 0]) ** 2 + (p[i, 1] - p[j, 1]) ** 2
                                        + (p[i, 2] - p[j, 2]) ** 2)
                                - np.sqrt((q[i, 0] - q[j, 0]) ** 2 + (q[i, 1] - q[j, 1]) ** 2
                                          + (q[i, 2] - q[j, 2]) ** 2))
                        value = np.exp(-0.5 * (d / sigma_d) ** 2)
                        weight[at] = value if d <= sigma_d else -value if d <= reach else 0.0
                        at += 1
    degree = np.zeros(n, np.int64)
    for i in range(n):
        for k in range(upper[i], upper[i + 1]):
            if weight[k] != 0:
                degree[i] += 1
                degree[index[k]] += 1
    return degree


@numba.njit(cache=True, nogil=True)
def _mirror(upper, index, weight, start, inner, full_index,  # type: ignore[no-untyped-def]
            full_weight):
    """Write each pair into both of its rows: consistent ones from the front, others behind."""
    n = len(inner)
    end = start[1:].copy()
    for i in range(n):
        full_index[start[i]] = i
        full_weight[start[i]] = 1.0
        inner[i] = start[i] + 1
    for i in range(n):
        for k in range(upper[i], upper[i + 1]):
            j = index[k]
            w = weight[k]
            if w > 0:
                full_index[inner[i]] = j
                full_weight[inner[i]] = w
                inner[i] += 1
                full_index[inner[j]] = i
                full_weight[inner[j]] = w
                inner[j] += 1
            elif w < 0:
                end[i] -= 1
                full_index[end[i]] = j
                full_weight[end[i]] = -w
                end[j] -= 1
                full_index[end[j]] = i
                full_weight[end[j]] = -w
