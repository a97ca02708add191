"""From pairwise registration to odometry: consecutive and keyframe mode, still without ROS."""
from dataclasses import dataclass
from dataclasses import replace
import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .core.common import se3
from .core.common.settings import setting
from .core.common.settings import Settings
from .core.config import SgorConfig
from .core.registration import register
from .core.result import Registration
from .core.scan.preprocessing import preprocess
from .core.scan.scan import PreparedScan
from .core.scan.scan import SemanticScan


@dataclass(frozen=True)
class TrackerConfig(Settings):
    """Which scan each scan is registered to."""

    mode: str = setting(
        'keyframe', 'Register to the scan before, or to the last keyframe',
        choices=('consecutive', 'keyframe'))
    keyframe_distance: float = setting(
        5.0, 'A scan farther from its keyframe becomes the next', 'm', minimum=0.1, maximum=100.0)
    keyframe_angle: float = setting(
        math.radians(20.0), 'A scan turned by more from its keyframe becomes the next', 'rad',
        minimum=0.01, maximum=math.pi)
    keyframe_inliers: float = setting(
        0.4, 'Below this share of the inliers that the first scan after the keyframe had, the '
        'scan becomes the next', minimum=0.0, maximum=1.0)
    max_failures: int = setting(
        5, 'After so many failures in a row the newest scan becomes the reference and the track '
        'goes on from the last known pose', minimum=1, maximum=1000)


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
        Linear and angular velocity in the sensor frame, m/s and rad/s, over the time since the
        reference; None where no time has passed or there is no step.
    registration : Registration or None
        The step from this scan to the reference; None for the first scan.
    reference_stamp_ns : int or None
        Stamp of the scan it was registered to.
    keyframe : bool
        Whether it is the reference of the next scan.
    restarted : bool
        Whether the track began here anew: the first scan, time that ran backwards, or
        `max_failures` failures in a row. After failures the pose is a guess, the last known one.
    warnings : tuple of str
    timings : dict of str to float
        Stage to seconds.
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


class Tracker:
    """Registers each scan to a reference and composes the poses.

    Live node and replay drive this same object. A failed registration gives a result without a
    pose; the reference stays, so the next scan bridges the gap and the track has no jump.
    """

    def __init__(self, config: SgorConfig | None = None,
                 tracker_config: TrackerConfig | None = None) -> None:
        self.config = config or SgorConfig()
        self.tracker_config = tracker_config or TrackerConfig()
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next scan is the origin of a new track."""
        self._reference: _Reference | None = None
        self._last_T_odom_sensor: NDArray[np.float64] = np.eye(4)
        self._failures = 0
        self._last_stamp_ns: int | None = None

    def track(self, scan: SemanticScan, stamp_ns: int) -> TrackedScan:
        """Take the next scan.

        Parameters
        ----------
        scan : SemanticScan
        stamp_ns : int
            Its stamp, nanoseconds. A stamp before the last one starts the track anew.
        """
        warnings: list[str] = []
        if self._last_stamp_ns is not None and stamp_ns < self._last_stamp_ns:
            warnings.append(f'time ran backwards by {(self._last_stamp_ns - stamp_ns) * 1e-9:.3f} '
                            's: the track starts anew')
            self.reset()
        self._last_stamp_ns = stamp_ns
        prepared = preprocess(
            scan, self.config,
            scale_before=self._reference.prepared.scale if self._reference else None)
        warnings += prepared.warnings
        if self._reference is None:
            return self._begin(prepared, stamp_ns, np.eye(4), np.zeros((6, 6)), warnings)
        reference = self._current_reference()
        step = register(prepared, reference.prepared, self.config)
        timings = {**prepared.timings, **step.timings}
        if not step.success or step.T_target_source is None:
            return self._fail(prepared, stamp_ns, step, warnings, timings)
        self._failures = 0
        T_odom_sensor = reference.T_odom_sensor @ step.T_target_source
        covariance = _compose_covariance(reference.T_odom_sensor, reference.covariance,
                                         step.T_target_source, step.covariance)
        self._last_T_odom_sensor = T_odom_sensor
        share = self._inlier_share(step)
        keyframe = self._is_keyframe(step.T_target_source, share)
        if keyframe:
            self._reference = _Reference(prepared, stamp_ns, T_odom_sensor, covariance)
        return TrackedScan(
            stamp_ns, True, '', T_odom_sensor, covariance,
            _twist(step.T_target_source, (stamp_ns - reference.stamp_ns) * 1e-9), step,
            reference.stamp_ns, keyframe, False, tuple(warnings), timings)

    def _begin(self, prepared: PreparedScan, stamp_ns: int, T_odom_sensor: NDArray[np.float64],
               covariance: NDArray[np.float64] | None, warnings: list[str]) -> TrackedScan:
        keypoints = len(prepared.features.points)
        if keypoints < self.config.min_inliers:
            # nothing could ever be registered to it
            return TrackedScan(stamp_ns, False, f'only {keypoints} keypoints to start from', None,
                               None, None, None, None, False, False, tuple(warnings),
                               dict(prepared.timings))
        self._failures = 0
        self._last_T_odom_sensor = T_odom_sensor
        self._reference = _Reference(prepared, stamp_ns, T_odom_sensor, covariance)
        return TrackedScan(stamp_ns, True, '', T_odom_sensor, covariance, None, None, None, True,
                           True, tuple(warnings), dict(prepared.timings))

    def _fail(self, prepared: PreparedScan, stamp_ns: int, step: Registration,
              warnings: list[str], timings: dict[str, float]) -> TrackedScan:
        """Keep the reference, so that the next scan bridges the gap; give up after some."""
        assert self._reference is not None
        old = self._reference
        self._failures += 1
        failures = self._failures
        # a scan that nothing can be registered to leaves the reference as it is
        lost = (failures >= self.tracker_config.max_failures
                and self._begin(prepared, stamp_ns, self._last_T_odom_sensor, None, []).success)
        if lost:
            warnings.append(f'{failures} registrations in a row failed: the track goes on '
                            'from the last known pose')
        return TrackedScan(stamp_ns, False, step.reason, None, None, None, step, old.stamp_ns,
                           lost, lost, tuple(warnings), timings)

    def _current_reference(self) -> '_Reference':
        """Prepare the reference again when a setting has changed since."""
        assert self._reference is not None
        if self._reference.prepared.config != self.config:
            self._reference = replace(self._reference, prepared=preprocess(
                self._reference.prepared.scan, self.config))
        return self._reference

    def _inlier_share(self, step: Registration) -> float:
        """Return the inliers relative to the first scan registered to this reference."""
        assert self._reference is not None
        count = int(step.inliers.sum())
        if self._reference.first_inliers is None:
            self._reference = replace(self._reference, first_inliers=count)
            return 1.0
        return count / max(self._reference.first_inliers, 1)

    def _is_keyframe(self, T_reference_scan: NDArray[np.float64], inlier_share: float) -> bool:
        c = self.tracker_config
        return (c.mode == 'consecutive'
                or float(np.linalg.norm(T_reference_scan[:3, 3])) > c.keyframe_distance
                or se3.angle(T_reference_scan[:3, :3]) > c.keyframe_angle
                or inlier_share < c.keyframe_inliers)


@dataclass(frozen=True, eq=False)
class _Reference:
    """The scan that the next one is registered to."""

    prepared: PreparedScan
    stamp_ns: int
    T_odom_sensor: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    first_inliers: int | None = None


def _compose_covariance(T_odom_reference: NDArray[np.float64],
                        odom: NDArray[np.float64] | None, T_reference_scan: NDArray[np.float64],
                        step: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Add the covariance of a step, given in the reference frame, to that of the reference.

    Both perturb from the left: T = exp(noise) T. Translation parts are of the moved origin, so a
    rotation error of the reference moves the scan by the lever arm to it.
    """
    if odom is None or step is None:
        return None
    R = T_odom_reference[:3, :3]
    lever = R @ T_reference_scan[:3, 3]
    carry = np.eye(6)
    carry[:3, 3:] = -np.array([[0, -lever[2], lever[1]], [lever[2], 0, -lever[0]],
                               [-lever[1], lever[0], 0]])
    turn = np.kron(np.eye(2), R)
    return carry @ odom @ carry.T + turn @ step @ turn.T


def _twist(T_reference_scan: NDArray[np.float64], seconds: float) -> NDArray[np.float64] | None:
    """Return the mean velocity since the reference in the sensor frame, (6,) m/s and rad/s."""
    if seconds <= 0:
        return None
    R = T_reference_scan[:3, :3]
    turn = Rotation.from_matrix(R).as_rotvec()
    return np.concatenate((R.T @ T_reference_scan[:3, 3], turn)) / seconds
