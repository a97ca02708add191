"""Of a registration: RE, TE, thresholds and recall, and the precision and recall of inliers."""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Threshold:
    """Within both an answer is right: degrees and metres."""

    name: str
    rotation_deg: float
    translation_m: float


EASY = Threshold('easy', 5.0, 0.6)
MEDIUM = Threshold('medium', 5.0, 0.3)
HARD = Threshold('hard', 2.0, 0.1)
LOOPS = Threshold('5 deg, 2 m', 5.0, 2.0)
INDOOR = Threshold('15 deg, 30 cm', 15.0, 0.3)


def rotation_error_deg(T_estimate: ArrayLike, T_truth: ArrayLike) -> float:
    """Return RE, the angle of R_estimate^T R_truth, degrees, of (4, 4) transformations."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    return float(np.rad2deg(se3.angle(estimate[:3, :3].T @ truth[:3, :3])))


def translation_error_m(T_estimate: ArrayLike, T_truth: ArrayLike) -> float:
    """Return TE, the distance of the translations of (4, 4) transformations, metres."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    return float(np.linalg.norm(estimate[:3, 3] - truth[:3, 3]))


def registration_recall(successes: Sequence[bool]) -> float:
    """Return RR, the share of successes, percent; NaN of none."""
    return 100 * sum(successes) / len(successes) if successes else float('nan')


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
    kept = np.flatnonzero(inlier_mask(source_points, target_points, T_estimate, threshold))
    return kept_scores(source_points, target_points, kept, T_truth, threshold)


def kept_scores(source_points: ArrayLike, target_points: ArrayLike, kept: ArrayLike,
                T_truth: ArrayLike, threshold: float) -> InlierScores:
    """Compare the matches that a method kept, rows (M,), with the inliers of the truth.

    The other arguments and the result are those of `inlier_scores`.
    """
    true = inlier_mask(source_points, target_points, T_truth, threshold)
    rows = np.asarray(kept, np.intp)
    both = float(np.sum(true[rows]))
    precision = both / max(len(rows), 1)
    recall = both / max(int(true.sum()), 1)
    f1 = 2 * precision * recall / (precision + recall) if both else 0.0
    return InlierScores(precision, recall, f1)


def inlier_mask(source_points: ArrayLike, target_points: ArrayLike, T_target_source: ArrayLike,
                threshold: float) -> NDArray[np.bool_]:
    """Tell which of the matches (K, 3) a transformation fits to less than a threshold, (K,)."""
    moved = se3.transform(np.asarray(T_target_source, np.float64),
                          np.asarray(source_points, np.float64))
    return np.asarray(
        np.linalg.norm(moved - np.asarray(target_points, np.float64), axis=1) < threshold)
