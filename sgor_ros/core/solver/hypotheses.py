"""One weighted SVD for all groups at once (Sec. III-C, Eq. 14 and 15)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..matching.correspondences import Correspondences
from .consistency import FilteredGroups

MIN_POINTS = 3
"""A rigid transformation needs three points that are not on a line."""


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Candidate transformations of the groups.

    Attributes
    ----------
    T_target_source : (H, 4, 4) float64
    union : (U,) int64
        G' of Eq. 18: the filtered correspondences of all groups, each once, those of groups
        without a hypothesis too.
    """

    T_target_source: NDArray[np.float64]
    union: NDArray[np.int64]


def hypothesise(correspondences: Correspondences, filtered: FilteredGroups) -> Hypotheses:
    """Fit a transformation to each group, its correspondences weighted by their scores.

    Groups with fewer than three consistent correspondences give no hypothesis.
    """
    enough = (filtered.scores > 0).sum(axis=1) >= MIN_POINTS
    kept = filtered.kept[enough]
    T = fit_transforms(correspondences.source[kept], correspondences.target[kept],
                       filtered.scores[enough].astype(np.float64))
    return Hypotheses(T, np.unique(filtered.kept[filtered.kept >= 0]))


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
    R = V @ U.swapaxes(1, 2)
    return se3.compose(R, mean_q - np.einsum('hij,hj->hi', R, mean_p))
