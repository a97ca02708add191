"""Errors of poses, inliers and trajectories, as the papers of the field define them."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from ..core.common import se3
from ..core.common.settings import InputError

Array = NDArray[np.float64]

THREE_SIGMA = float(chi2.ppf(0.9973, 6))
"""The NEES of a pose stays below in as many cases as a number stays within 3 sigma."""

KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Lengths over which the KITTI benchmark measures drift."""


def rotation_error_deg(T_estimate: ArrayLike, T_truth: ArrayLike) -> float:
    """Return RE, the angle of R_estimate^T R_truth, degrees, of (4, 4) transformations."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    return float(np.rad2deg(se3.angle(estimate[:3, :3].T @ truth[:3, :3])))


def translation_error_m(T_estimate: ArrayLike, T_truth: ArrayLike) -> float:
    """Return TE, the distance of the translations of (4, 4) transformations, metres."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    return float(np.linalg.norm(estimate[:3, 3] - truth[:3, 3]))


def squared_normalised_error(T_estimate: ArrayLike, T_truth: ArrayLike,
                             covariance: ArrayLike | None) -> float:
    """Return NEES: how far off an estimate is, measured by its own covariance.

    Parameters
    ----------
    T_estimate, T_truth : (4, 4) array
        T_target_source.
    covariance : (6, 6) array or None
        As of `Registration`.

    Returns
    -------
    float
        Squared Mahalanobis distance: 6 on average where the covariance is right; infinite where
        it claims that there is no error at all in some direction, NaN without one.
    """
    if covariance is None:
        return float('nan')
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    turn = Rotation.from_matrix(truth[:3, :3] @ estimate[:3, :3].T).as_rotvec()
    error = np.concatenate((truth[:3, 3] - estimate[:3, 3], turn))
    try:
        root = np.linalg.cholesky(np.asarray(covariance, np.float64))
    except np.linalg.LinAlgError:
        return float('inf')
    whitened = np.linalg.solve(root, error)
    return float(whitened @ whitened)


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


@dataclass(frozen=True)
class Drift:
    """Mean error over all stretches of the given lengths, relative to their length.

    Attributes
    ----------
    translation_percent : float
    rotation_deg_per_m : float
    stretches : int
        How many were averaged; with 0 the errors are NaN.
    """

    translation_percent: float
    rotation_deg_per_m: float
    stretches: int


def travelled_m(T_world_sensor: ArrayLike) -> Array:
    """Return the (N,) way travelled up to each of (N, 4, 4) poses, metres."""
    positions = np.asarray(T_world_sensor, np.float64)[:, :3, 3]
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def drift(T_estimate: ArrayLike, T_truth: ArrayLike,
          lengths_m: tuple[float, ...] = KITTI_LENGTHS_M) -> Drift:
    """Measure the drift of a trajectory as the KITTI benchmark does.

    From each pose on, each length is travelled along the truth, and the error of the motion over
    that stretch is divided by the length. The benchmark starts at every tenth pose only; here
    every pose starts, so that short trajectories give a figure too.

    Parameters
    ----------
    T_estimate, T_truth : (N, 4, 4) array
        Poses of the same scans, each in a frame of its own.
    lengths_m : tuple of float
        Lengths of the stretches, metres; those longer than the trajectory are left out.

    Raises
    ------
    InputError
        Shapes that differ or are not (N, 4, 4).
    """
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    if estimate.shape != truth.shape or truth.ndim != 3 or truth.shape[1:] != (4, 4):
        raise InputError(f'poses: expected (N, 4, 4) twice, got {estimate.shape} '
                         f'and {truth.shape}')
    way = travelled_m(truth) if len(truth) else np.empty(0)
    errors = []
    for length in lengths_m:
        # the first pose that is at least so far on
        ends = np.searchsorted(way, way + length)
        for first in np.flatnonzero(ends < len(way)):
            last = ends[first]
            moved = se3.inverse(estimate[first]) @ estimate[last]
            true = se3.inverse(truth[first]) @ truth[last]
            # of the end in the estimate's own end frame, as the benchmark's code has it
            error = se3.inverse(moved) @ true
            errors.append((np.linalg.norm(error[:3, 3]) / length,
                           np.rad2deg(se3.angle(error[:3, :3])) / length))
    if not errors:
        return Drift(float('nan'), float('nan'), 0)
    translation, rotation = np.mean(errors, axis=0)
    return Drift(float(100 * translation), float(rotation), len(errors))


def consecutive_errors(T_estimate: ArrayLike, T_truth: ArrayLike) -> tuple[Array, Array]:
    """Return RE (N - 1,), degrees, and TE (N - 1,), metres, of each pose to the one before."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    steps = [(se3.inverse(estimate[i]) @ estimate[i + 1], se3.inverse(truth[i]) @ truth[i + 1])
             for i in range(len(truth) - 1)]
    return (np.array([rotation_error_deg(*step) for step in steps]),
            np.array([translation_error_m(*step) for step in steps]))
