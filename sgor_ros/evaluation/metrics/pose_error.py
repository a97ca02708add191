"""RE and TE of a registration, and its NEES: the error measured by its own covariance."""
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from ...core.common import se3

NEES_95 = float(chi2.ppf(0.95, 6))
NEES_BOUND = float(chi2.ppf(0.9973, 6))
"""The NEES of a pose stays below in as many cases as a number stays within 3 sigma."""


def rotation_error_deg(T_estimate: ArrayLike, T_truth: ArrayLike) -> float:
    """Return RE, the angle of R_estimate^T R_truth, degrees, of (4, 4) transformations."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    return float(np.rad2deg(se3.angle(estimate[:3, :3].T @ truth[:3, :3])))


def translation_error_m(T_estimate: ArrayLike, T_truth: ArrayLike) -> float:
    """Return TE, the distance of the translations of (4, 4) transformations, metres."""
    estimate, truth = np.asarray(T_estimate, np.float64), np.asarray(T_truth, np.float64)
    return float(np.linalg.norm(estimate[:3, 3] - truth[:3, 3]))


def nees(T_estimate: ArrayLike, T_truth: ArrayLike, covariance: ArrayLike | None) -> float:
    """Return NEES, the error of an estimate squared and normalised by its own covariance.

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
