"""What became of one scan: `State`, `TrackedScan`."""
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..core.verdict.result import Registration


class State(StrEnum):
    """What the track is in after a scan."""

    NEW_TRACK = 'new track'
    """The scan is the origin of a new track."""
    TRACKING = 'tracking'
    DEGENERATE = 'degenerate'
    """There is a pose, but along some direction it is predicted, and its covariance grows."""
    FAILED = 'failed'
    """No pose for this scan; the next may bridge the gap."""
    LOST = 'lost'
    """No pose for many scans; all keyframes are tried in turns."""
    LATE = 'late'
    """The scan was dropped: its stamp is not after that of the scan before."""


@dataclass(frozen=True, eq=False)
class TrackedScan:
    """What became of one scan.

    Attributes
    ----------
    stamp_ns : int
        Stamp of the scan, nanoseconds.
    success : bool
        Whether the pose is known; the first scan of a track is its origin.
    reason : str
        Why not, in words.
    T_odom_sensor : (4, 4) float64 or None
        Pose of the sensor in the frame of the track's first scan; None without success.
    covariance : (6, 6) float64 or None
        Of the pose since the start of the track: (x, y, z, rotation about x, y, z) in the odom
        frame, m^2 and rad^2. None where a step gave none.
    twist : (6,) float64 or None
        Linear and angular velocity in the sensor frame, m/s and rad/s, of the motion since the
        pose before; None where there is none, or where the track was lost in between.
    registration : Registration or None
        The step from this scan to the reference; None for the first scan.
    reference_stamp_ns : int or None
        Stamp of the scan it was registered to.
    keyframe : bool
        Whether it is the reference of the next scan: it has a `keyframe_id` then.
    restarted : bool
        Whether a new track began here.
    warnings : tuple of str
    timings : dict of str to float
        Stage to seconds.
    state : State
    track_id : int
        Poses of one number are in one frame. Counts up from 1; an old track can come back.
    twist_covariance : (6, 6) float64 or None
        Of the twist; times the squared time since the pose before, it is that of the motion.
    T_reference_sensor : (4, 4) float64 or None
        The relative pose that the tracker stands by: that of the registration, or of the
        placement that the motion chose, or with predicted directions; None without a step.
    reference_covariance : (6, 6) float64 or None
        Of that relative pose, in the frame of the reference; positive definite.
    failures : int
        Scans in a row without a pose, with this one.
    late : int
        Scans dropped so far because of their stamps.
    confirmed : bool
        Whether the clouds confirmed the motion that was predicted, so that SGOR did not run:
        `registration` comes from `check_prediction`.
    keyframe_id, reference_id : int or None
        Ids of this scan and of what it was registered to, among all keyframes of the tracker;
        None where it is none, and without a step.
    """

    stamp_ns: int
    success: bool
    reason: str
    T_odom_sensor: NDArray[np.float64] | None
    covariance: NDArray[np.float64] | None
    twist: NDArray[np.float64] | None
    registration: Registration | None
    reference_stamp_ns: int | None
    keyframe: bool
    restarted: bool
    warnings: tuple[str, ...]
    timings: dict[str, float]
    state: State = State.TRACKING
    track_id: int = 1
    twist_covariance: NDArray[np.float64] | None = None
    T_reference_sensor: NDArray[np.float64] | None = None
    reference_covariance: NDArray[np.float64] | None = None
    failures: int = 0
    late: int = 0
    confirmed: bool = False
    keyframe_id: int | None = None
    reference_id: int | None = None


def without_pose(stamp_ns: int, state: State, reason: str, track_id: int, failures: int, late: int,
                 warnings: tuple[str, ...] = ()) -> TrackedScan:
    """Return what became of a scan that was not worked on."""
    return TrackedScan(stamp_ns, False, reason, None, None, None, None, None, False, False,
                       warnings, {}, state, track_id, failures=failures, late=late)
