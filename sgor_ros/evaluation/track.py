"""A track of poses against ground truth: the errors that a report or a plot needs."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from .metrics import consecutive_errors
from .metrics import Drift
from .metrics import drift
from .metrics import rotation_error_deg
from .metrics import translation_error_m
from .metrics import travelled_m

Array = NDArray[np.float64]

STRETCHES_M = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Lengths for the drift of a drive that is too short for those of KITTI."""


@dataclass(frozen=True, eq=False)
class TrackErrors:
    """Errors of a track.

    Attributes
    ----------
    rotation_deg, translation_m : (N - 1,) float64
        RE and TE of each pose relative to the one before.
    drift : Drift
    length_m : float
        Way travelled along the truth.
    end_rotation_deg, end_translation_m : float
        Error of the last pose, relative to the first.
    estimate : (N, 4, 4) float64
        The track in the frame of the truth, laid on it at the first pose.
    """

    rotation_deg: Array
    translation_m: Array
    drift: Drift
    length_m: float
    end_rotation_deg: float
    end_translation_m: float
    estimate: Array


def track_errors(T_odom_sensor: Array, T_world_sensor: Array,
                 lengths_m: tuple[float, ...] = STRETCHES_M) -> TrackErrors:
    """Compare a track (N, 4, 4), N at least 1, with the true poses of the same scans."""
    T_world_odom = T_world_sensor[0] @ se3.inverse(T_odom_sensor[0])
    estimate = T_world_odom @ T_odom_sensor
    rotation, translation = consecutive_errors(estimate, T_world_sensor)
    return TrackErrors(
        rotation, translation, drift(estimate, T_world_sensor, lengths_m),
        float(travelled_m(T_world_sensor)[-1]),
        rotation_error_deg(estimate[-1], T_world_sensor[-1]),
        translation_error_m(estimate[-1], T_world_sensor[-1]), estimate)
