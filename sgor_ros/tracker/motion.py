"""Where the next scan is expected: constant velocity, with a covariance that grows."""
from dataclasses import dataclass
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from .config import TrackerConfig

Array = NDArray[np.float64]

GATE = 20.06
"""Squared distance in six dimensions that 99.7 % of right placements stay below."""
ACCELERATION_S = 1.0
"""Seconds over which an acceleration lasts."""
NARROW_M = 0.5
"""Root of the summed variances below which a prediction is near enough to be fitted."""
SHORTEST_S = 0.1
"""Bounds on speed allow this much time at least: stamps jitter."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Pose and velocity at a stamp, relative to the reference, and how sure they are.

    Attributes
    ----------
    stamp_ns : int
    T_reference_sensor : (4, 4) float64
    twist : (6,) float64
        In the sensor frame, m/s and rad/s.
    covariance : (12, 12) float64
        Of the pose, in the reference frame, then of the twist, in the sensor frame.
    """

    stamp_ns: int
    T_reference_sensor: Array
    twist: Array
    covariance: Array

    @classmethod
    def unknown(cls, stamp_ns: int, T_reference_sensor: Array, covariance: Array,
                config: TrackerConfig) -> Self:
        """Return a pose whose velocity nobody knows: half the bounds are one sigma."""
        both = np.zeros((12, 12))
        both[:6, :6] = covariance
        both[6:, 6:] = np.diag([(config.max_speed / 2)**2] * 3 + [(config.max_turn_rate / 2)**2]
                               * 3)
        return cls(stamp_ns, T_reference_sensor, np.zeros(6), both)

    @property
    def pose_covariance(self) -> Array:
        """The (6, 6) covariance of the pose."""
        return self.covariance[:6, :6]

    @property
    def twist_covariance(self) -> Array:
        """The (6, 6) covariance of the twist."""
        return self.covariance[6:, 6:]

    def is_narrow(self) -> bool:
        """Whether the predicted position is certain to within the reach of a fit to the clouds."""
        return float(np.trace(self.pose_covariance[:3, :3])) < NARROW_M**2

    def seconds_to(self, stamp_ns: int) -> float:
        """Return the time from here to a stamp."""
        return (stamp_ns - self.stamp_ns) * 1e-9

    def before(self, stamp_ns: int, config: TrackerConfig) -> Self:
        """Return this motion; where its stamp lies in the future of another, its place alone."""
        return self if self.stamp_ns < stamp_ns else self.unknown(
            stamp_ns - 1, self.T_reference_sensor, self.pose_covariance, config)

    def predict(self, stamp_ns: int, config: TrackerConfig) -> Self:
        """Go on with the same velocity, which may change by the accelerations of the settings."""
        seconds = self.seconds_to(stamp_ns)
        R = self.T_reference_sensor[:3, :3]
        T = self.T_reference_sensor @ se3.exp(self.twist * seconds)
        change = np.array([config.acceleration] * 3 + [config.turn_acceleration] * 3)
        P = self.covariance.copy()
        P[6:, 6:] += np.diag(change**2 * ACCELERATION_S * seconds)
        F = np.eye(12)
        F[:6, :6] = se3.carried(T[:3, 3] - self.T_reference_sensor[:3, 3])
        F[:6, 6:] = se3.turned(R) * seconds
        return type(self)(stamp_ns, T, self.twist, F @ P @ F.T)

    def measured(self, stamp_ns: int, T_reference_sensor: Array, covariance: Array) -> Self:
        """Take a pose as it was measured; the velocity is that from here to it."""
        seconds = self.seconds_to(stamp_ns)
        moved = se3.inverse(self.T_reference_sensor) @ T_reference_sensor
        carry = se3.carried(T_reference_sensor[:3, 3] - self.T_reference_sensor[:3, 3])
        back = se3.turned(T_reference_sensor[:3, :3].T) / seconds
        both = np.empty((12, 12))
        both[:6, :6] = covariance
        both[6:, :6] = back @ covariance
        both[:6, 6:] = both[6:, :6].T
        both[6:, 6:] = back @ (covariance + carry @ self.pose_covariance @ carry.T) @ back.T
        return type(self)(stamp_ns, T_reference_sensor, se3.log(moved) / seconds, both)

    def distance(self, T_reference_sensor: Array, information: Array) -> float:
        """Return the squared Mahalanobis distance of a placement with a (6, 6) information."""
        d = se3.perturbation(T_reference_sensor, self.T_reference_sensor)
        spread = np.eye(6) + self.pose_covariance @ information
        return float(d @ information @ np.linalg.solve(spread, d))

    def fuse(self, T_reference_sensor: Array, information: Array) -> Self:
        """Correct by a placement; where its (6, 6) information is zero, nothing changes."""
        d = se3.perturbation(T_reference_sensor, self.T_reference_sensor)
        spread = np.eye(6) + self.pose_covariance @ information
        gain = self.covariance[:, :6] @ information @ np.linalg.inv(spread)
        by = gain @ d
        P = self.covariance - gain @ self.covariance[:6]
        return type(self)(self.stamp_ns, se3.perturbed(self.T_reference_sensor, by[:6]),
                          self.twist + by[6:], (P + P.T) / 2)

    def impossible(self, stamp_ns: int, T_reference_sensor: Array, config: TrackerConfig) -> str:
        """Return which bound a placement at a stamp breaks, in words; empty if none."""
        seconds = max(self.seconds_to(stamp_ns), SHORTEST_S)
        moved = se3.inverse(self.T_reference_sensor) @ T_reference_sensor
        # what is not known of the pose before may have been part of it
        margin = 3 * np.sqrt(np.trace(self.pose_covariance[:3, :3]))
        speed = max(0.0, float(np.linalg.norm(moved[:3, 3])) - margin) / seconds
        if speed > config.max_speed:
            return f'{speed:.1f} m/s is over max_speed {config.max_speed:.1f}'
        margin = 3 * np.sqrt(np.trace(self.pose_covariance[3:, 3:]))
        rate = max(0.0, se3.angle(moved[:3, :3]) - margin) / seconds
        if rate > config.max_turn_rate:
            return f'{rate:.2f} rad/s is over max_turn_rate {config.max_turn_rate:.2f}'
        return ''

    def at_new_reference(self) -> Self:
        """Return the same where the scan itself has become the reference."""
        P = np.zeros((12, 12))
        P[6:, 6:] = self.twist_covariance
        return replace(self, T_reference_sensor=np.eye(4), covariance=P)
