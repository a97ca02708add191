"""Top-k filter and one weighted SVD for all groups at once (Sec. III-C, Eq. 13 to 15)."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from .correspondences import Correspondences
from .grouping import Groups

MIN_POINTS = 3
"""A rigid transformation needs three points that are not on a line."""


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Candidate transformations of the groups.

    Attributes
    ----------
    T_target_source : (H, 4, 4) float64
    kept : (H, k1) int64
        Correspondences G'_l behind each; -1 where fewer were left.
    """

    T_target_source: NDArray[np.float64]
    kept: NDArray[np.int64]


def hypothesise(correspondences: Correspondences, groups: Groups, rows: NDArray[np.float32],
                keep: int) -> Hypotheses:
    """Keep the `keep` best of each group by its row of M* and fit a transformation to them.

    Groups with fewer than three consistent correspondences give no hypothesis.
    """
    keep = min(keep, rows.shape[1])
    best = _top(rows, keep)
    score = np.take_along_axis(rows, best, axis=1).astype(np.float64)
    kept = np.take_along_axis(groups.members, best, axis=1)
    enough = (score > 0).sum(axis=1) >= MIN_POINTS
    score, kept = score[enough], kept[enough]
    T = fit_transforms(correspondences.source[kept], correspondences.target[kept], score)
    return Hypotheses(T, np.where(score > 0, kept, -1))


def fit_transforms(source: NDArray[np.float64], target: NDArray[np.float64],
                   weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit rigid transformations to weighted matches by SVD (Eq. 14).

    Parameters
    ----------
    source, target : (H, k, 3) float64
        Metres.
    weights : (H, k) float64
        Not negative; scaled to sum one (Eq. 15).

    Returns
    -------
    (H, 4, 4) float64
        T_target_source of each.
    """
    w = weights / weights.sum(axis=1, keepdims=True)
    mean_p = np.einsum('hk,hkd->hd', w, source)
    mean_q = np.einsum('hk,hkd->hd', w, target)
    p, q = source - mean_p[:, None], target - mean_q[:, None]
    U, _, Vt = np.linalg.svd(np.einsum('hk,hki,hkj->hij', w, p, q, optimize=True))
    V = Vt.swapaxes(1, 2)
    V[:, :, 2] *= np.linalg.det(V @ U.swapaxes(1, 2))[:, None]    # no reflections
    T = np.tile(np.eye(4), (len(w), 1, 1))
    T[:, :3, :3] = V @ U.swapaxes(1, 2)
    T[:, :3, 3] = mean_q - np.einsum('hij,hj->hi', T[:, :3, :3], mean_p)
    return T


@numba.njit(cache=True, nogil=True, parallel=True)
def _top(rows, keep):  # type: ignore[no-untyped-def]
    """Return the columns of the `keep` largest entries of each row, largest first, (L, keep)."""
    best = np.zeros((len(rows), keep), np.int64)
    for g in numba.prange(len(rows)):
        value = np.full(keep, -1.0, np.float32)
        for j in range(rows.shape[1]):
            if rows[g, j] > value[keep - 1]:
                at = keep - 1
                while at > 0 and value[at - 1] < rows[g, j]:
                    value[at] = value[at - 1]
                    best[g, at] = best[g, at - 1]
                    at -= 1
                value[at] = rows[g, j]
                best[g, at] = j
    return best
