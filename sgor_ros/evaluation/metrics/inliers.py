"""IP, IR and F1: precision and recall of the matches that a method keeps."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3


@dataclass(frozen=True)
class InlierScores:
    """How well inliers were told from outliers; each 0 to 1.

    Attributes
    ----------
    precision : float
        IP: share of the kept correspondences that are true.
    recall : float
        IR: share of the true correspondences that were kept.
    f1 : float
        Harmonic mean of both.
    """

    precision: float
    recall: float
    f1: float


def inlier_scores(source_points: ArrayLike, target_points: ArrayLike, T_estimate: ArrayLike,
                  T_truth: ArrayLike, threshold: float) -> InlierScores:
    """Compare the inliers of an estimate with those of the truth.

    Parameters
    ----------
    source_points, target_points : (K, 3) array
        Correspondences, metres.
    T_estimate, T_truth : (4, 4) array
        T_target_source.
    threshold : float
        Largest residual of an inlier, metres: 0.6 on KITTI, 0.1 on 3DMatch.

    Returns
    -------
    InlierScores
        A score with nothing to divide by is 0.
    """
    kept = np.flatnonzero(_agree(source_points, target_points, T_estimate, threshold))
    return kept_scores(source_points, target_points, kept, T_truth, threshold)


def kept_scores(source_points: ArrayLike, target_points: ArrayLike, kept: ArrayLike,
                T_truth: ArrayLike, threshold: float) -> InlierScores:
    """Compare the matches that a method kept, rows (M,), with the inliers of the truth.

    The other arguments and the result are those of `inlier_scores`.
    """
    true = _agree(source_points, target_points, T_truth, threshold)
    rows = np.asarray(kept, np.intp)
    both = float(np.sum(true[rows]))
    precision = both / max(len(rows), 1)
    recall = both / max(int(true.sum()), 1)
    f1 = 2 * precision * recall / (precision + recall) if both else 0.0
    return InlierScores(precision, recall, f1)


def _agree(source: ArrayLike, target: ArrayLike, T: ArrayLike, threshold: float
           ) -> NDArray[np.bool_]:
    moved = se3.transform(np.asarray(T, np.float64), np.asarray(source, np.float64))
    return np.asarray(
        np.linalg.norm(moved - np.asarray(target, np.float64), axis=1) < threshold)
