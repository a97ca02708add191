"""Consistency of a tracker: each scan of a drive, and its NEES, against the truth."""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...tracker import State
from ...tracker import TrackedScan
from .pose_error import nees
from .pose_error import NEES_BOUND
from .pose_error import translation_error_m

Array = NDArray[np.float64]

METRES_WRONG = 1.0
"""A pose that is off by more, outside of what its covariance allows, is dangerous."""


@dataclass(frozen=True)
class ScanConsistency:
    """What the tracker claims of one scan, and its error; NaN where it claims nothing.

    Attributes
    ----------
    state : str
        Value of its `State`.
    error_m : float
        Of the pose since the start of its track.
    claimed_m : float
        One standard deviation of that, by the covariance: root of the sum over x, y and z.
    step_nees, pose_nees : float
        Of the step to the reference, and of that pose.
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
    def metres_wrong(self) -> bool:
        """Whether the pose is metres off, which its covariance excludes."""
        return self.error_m > METRES_WRONG and self.pose_nees > NEES_BOUND


def track_consistency(tracked: Sequence[TrackedScan], T_world_sensor: Array
                      ) -> list[ScanConsistency]:
    """Compare what a tracker claims of N scans with their (N, 4, 4) true poses."""
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
