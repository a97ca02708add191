"""Whether errors are as large as covariances claim: NEES of registrations and of a track.

NEES (normalised estimation error squared) is chi-square distributed with 6 degrees of freedom
where a covariance is consistent (Bar-Shalom et al., Estimation with Applications, 5.4).
"""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from ...core.common import se3
from ...tracker import State
from ...tracker import TrackedScan
from .registration import translation_error_m

Array = NDArray[np.float64]

NEES_BOUND = float(chi2.ppf(0.9973, 6))
"""The NEES of a pose stays below in as many cases as a number stays within 3 sigma."""

LARGE_ERROR_M = 1.0
"""A pose that is off by more, which its covariance excludes, is dangerous."""


def nees(T_estimate: ArrayLike, T_truth: ArrayLike, covariance: ArrayLike | None) -> float:
    """Return the normalised estimation error squared of a pose, by its own covariance.

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
class ScanConsistency:
    """Errors of one scan of a track beside its covariances; NaN where it has none.

    Attributes
    ----------
    state : str
        Value of its `State`.
    error_m : float
        Of the pose since the start of its track.
    claimed_m : float
        One standard deviation of that, by the covariance: root of the sum over x, y and z.
    step_nees, pose_nees : float
        Squared normalised errors of the step to the reference, and of that pose.
    confirmed : bool
        Whether it was the prediction that the clouds confirmed, and SGOR did not run.
    """

    state: str
    error_m: float
    claimed_m: float
    step_nees: float
    pose_nees: float
    confirmed: bool

    @property
    def inconsistent(self) -> bool:
        """Whether the pose is metres off, which its covariance excludes."""
        return self.error_m > LARGE_ERROR_M and self.pose_nees > NEES_BOUND


def track_consistency(tracked: Sequence[TrackedScan], T_world_sensor: Array
                      ) -> list[ScanConsistency]:
    """Compare the results of a tracker for N scans with their (N, 4, 4) true poses."""
    truth = {scan.stamp_ns: T for scan, T in zip(tracked, T_world_sensor, strict=True)}
    origin = {scan.track_id: truth[scan.stamp_ns] for scan in tracked if scan.restarted}
    return [_of_scan(scan, truth, origin) for scan in tracked]


def _of_scan(scan: TrackedScan, truth: dict[int, Array], origin: dict[int, Array]
             ) -> ScanConsistency:
    error = claimed = step = pose = float('nan')
    T = truth[scan.stamp_ns]
    if scan.T_reference_sensor is not None and scan.reference_stamp_ns is not None:
        step = nees(
            scan.T_reference_sensor, se3.inverse(truth[scan.reference_stamp_ns]) @ T,
            scan.reference_covariance)
    if scan.T_odom_sensor is not None and scan.state is not State.NEW_TRACK:
        moved = se3.inverse(origin[scan.track_id]) @ T
        error = translation_error_m(scan.T_odom_sensor, moved)
        pose = nees(scan.T_odom_sensor, moved, scan.covariance)
        if scan.covariance is not None:
            claimed = float(np.sqrt(np.trace(scan.covariance[:3, :3])))
    return ScanConsistency(scan.state, error, claimed, step, pose, scan.confirmed)
