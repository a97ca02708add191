"""Whether a covariance holds: normalised estimation error squared (NEES) along a track."""
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..tracker import TrackedScan

Array = NDArray[np.float64]

BOUND = 20.06
"""In six dimensions 99.7 % of the NEES of a right covariance lie below; the mean is 6."""


def nees(T_estimate: Array, T_truth: Array, covariance: Array) -> float:
    """Return the squared Mahalanobis distance of a (4, 4) estimate from the truth.

    The (6, 6) covariance is of (x, y, z, rotation about x, y, z) in the frame of the estimate.
    """
    error = se3.perturbation(T_estimate, T_truth)
    return float(error @ np.linalg.solve(covariance, error))


def track_nees(tracked: Sequence[TrackedScan], T_world_sensor: Array) -> tuple[Array, Array]:
    """Return the NEES of the steps and of the poses of a track, of all that have a covariance.

    Parameters
    ----------
    tracked : sequence of N TrackedScan
    T_world_sensor : (N, 4, 4) float64
        True poses of the same scans.

    Returns
    -------
    relative : (K,) float64
        Of each scan to its reference.
    absolute : (L,) float64
        Of each scan to the origin of its track.
    """
    truth = {scan.stamp_ns: T for scan, T in zip(tracked, T_world_sensor, strict=True)}
    origin = {scan.track_id: truth[scan.stamp_ns] for scan in tracked if scan.restarted}
    relative, absolute = [], []
    for scan in tracked:
        if scan.T_reference_sensor is None or scan.reference_stamp_ns is None:
            continue
        T = truth[scan.stamp_ns]
        if scan.reference_covariance is not None:
            relative.append(nees(scan.T_reference_sensor,
                                 se3.inverse(truth[scan.reference_stamp_ns]) @ T,
                                 scan.reference_covariance))
        if scan.covariance is not None and scan.T_odom_sensor is not None:
            absolute.append(nees(scan.T_odom_sensor, se3.inverse(origin[scan.track_id]) @ T,
                                 scan.covariance))
    return np.array(relative), np.array(absolute)
