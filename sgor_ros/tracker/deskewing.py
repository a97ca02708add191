"""Deskewing by the motion that is expected, and again where it is known only afterwards."""
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.prepared_scan import PreparedScan
from ..core.preprocessing import preprocess
from ..core.scan.deskewing import deskewed
from ..core.scan.scan import SemanticScan
from .config import TrackerConfig
from .motion import Motion

Array = NDArray[np.float64]

FADING = 0.7
"""Weight of what was before, in the mean of squares."""
LAG = 1.5
"""From the middle of the last two sweeps to that of the next, in scans."""
LONGEST_STEP_S = 1.0
"""From two scans farther apart in time nobody can tell how fast the sensor moved at either."""


def is_skewed(prepared: PreparedScan) -> bool:
    """Whether a scan is bent by the motion during the sweep, as it came."""
    return prepared.scan is not None and prepared.scan.times is not None


@dataclass(frozen=True, eq=False)
class Sweep:
    """The last scan that has a pose: where the sensor was in the middle of its sweep.

    A scan that is deskewed by a wrong velocity lies wrong at its stamp, and right in the middle of
    its sweep. The velocity between two middles is therefore free of what was assumed before.

    Attributes
    ----------
    track_id : int
    seconds : float
        Time of the middle.
    T_odom_middle : (4, 4) float64
        Pose of the sensor then.
    covariance : (6, 6) float64
        Of that pose, seen from the reference.
    twist : (6,) float64 or None
        From the middle of the scan before to this one's; None where there was none.
    twist_covariance : (6, 6) float64 or None
        Of the twist.
    changes : (6,) float64
        Mean square of what it changed by from scan to scan, (m/s)^2 and (rad/s)^2.
    """

    track_id: int
    seconds: float
    T_odom_middle: Array
    covariance: Array
    twist: Array | None = None
    twist_covariance: Array | None = None
    changes: Array = field(default_factory=lambda: np.zeros(6))

    @classmethod
    def of(cls, track_id: int, stamp_ns: int, T_odom_sensor: Array, covariance: Array,
           deskewed_by: Array | None, middle_s: float) -> 'Sweep':
        """Return that of a scan at a pose, deskewed by a twist, taken so long after its stamp."""
        ahead = np.eye(4) if deskewed_by is None else se3.exp(deskewed_by * middle_s)
        return cls(track_id, stamp_ns * 1e-9 + middle_s, T_odom_sensor @ ahead, covariance)

    def then(self, other: 'Sweep') -> 'Sweep':
        """Return the one that follows, with the velocity between."""
        seconds = other.seconds - self.seconds
        if self.track_id != other.track_id or not 0 < seconds < LONGEST_STEP_S:
            return other
        twist = se3.log(se3.inverse(self.T_odom_middle) @ other.T_odom_middle) / seconds
        covariance = (self.covariance + other.covariance) / seconds**2
        changes = self.changes if self.twist is None else (
            FADING * self.changes + (1 - FADING) * (twist - self.twist)**2)
        return replace(other, twist=twist, twist_covariance=covariance, changes=changes)


def by_expected_motion(scan: SemanticScan, sweep: Sweep | None, config: TrackerConfig
                       ) -> tuple[SemanticScan, Array | None]:
    """Return a scan deskewed by the velocity of the sweep before.

    Parameters
    ----------
    scan : SemanticScan
    sweep : Sweep or None
        The one before. Where it has no velocity the scan stays as it is.
    config : TrackerConfig
        Its bounds are what is known of a velocity that nobody has measured.

    Returns
    -------
    SemanticScan
    (6, 6) array or None
        Covariance of its frame, for what is not known of the velocity; None without times.
    """
    if scan.times is None:
        return scan, None
    if sweep is None or sweep.twist is None or sweep.twist_covariance is None:
        unknown = Motion.unknown(0, np.eye(4), np.zeros((6, 6)), config)
        return scan, _frame_covariance(scan.times, unknown.twist_covariance)
    return deskewed(scan, sweep.twist), _frame_covariance(
        scan.times, sweep.twist_covariance + np.diag(LAG**2 * sweep.changes))


def with_frames(covariance: Array, T_target_source: Array, source: Array | None,
                target: Array | None) -> Array:
    """Add to the (6, 6) covariance of a relative pose those of the frames of both scans."""
    if source is not None:
        turn = se3.turned(T_target_source[:3, :3])
        covariance = covariance + turn @ source @ turn.T
    if target is not None:
        lever = se3.carried(T_target_source[:3, 3])
        covariance = covariance + lever @ target @ lever.T
    return covariance


def by_step(prepared: PreparedScan, twist: Array, twist_covariance: Array) -> PreparedScan:
    """Deskew one of two scans by the velocity from one to the other, and prepare it again.

    Parameters
    ----------
    prepared : PreparedScan
        As it came, see `is_skewed`.
    twist : (6,) array
    twist_covariance : (6, 6) array
    """
    scan = prepared.raw('its motion is known now')
    assert scan.times is not None
    again = preprocess(deskewed(scan, twist), prepared.config, scale_before=prepared.scale,
                       up_before=None if prepared.ground is None else prepared.ground.normal)
    return replace(again, frame_covariance=_frame_covariance(scan.times, twist_covariance))


def _frame_covariance(times: Array, twist_covariance: Array) -> Array:
    """Points that were taken when the frame was elsewhere by an error of the twist times time."""
    covariance: Array = float(np.mean(times**2)) * twist_covariance
    return covariance
