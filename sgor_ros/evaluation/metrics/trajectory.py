"""Errors of a trajectory: APE (ATE) and RPE by evo, and the drift of the KITTI benchmark."""
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ..extra import INSTALL
from .registration import rotation_error_deg
from .registration import translation_error_m

Array = NDArray[np.float64]

KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Lengths over which the KITTI benchmark measures drift."""

STRETCHES_M = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Lengths for the drift of a drive that is too short for those of KITTI."""


@dataclass(frozen=True, eq=False)
class TrajectoryErrors:
    """Errors of a trajectory.

    Attributes
    ----------
    rpe_rotation_deg, rpe_translation_m : (N - 1,) float64
        RPE of each pose relative to the one before.
    ape_translation_m : (N,) float64
        APE of each position, the trajectories laid on each other at the first pose.
    drift : Drift
    length_m : float
        Way travelled along the truth.
    end_rotation_deg, end_translation_m : float
        Error of the last pose, relative to the first.
    estimate : (N, 4, 4) float64
        The trajectory in the frame of the truth, laid on it at the first pose.
    """

    rpe_rotation_deg: Array
    rpe_translation_m: Array
    ape_translation_m: Array
    drift: 'Drift'
    length_m: float
    end_rotation_deg: float
    end_translation_m: float
    estimate: Array


def trajectory_errors(T_odom_sensor: Array, T_world_sensor: Array,
                      lengths_m: tuple[float, ...] = STRETCHES_M) -> TrajectoryErrors:
    """Compare a trajectory (N, 4, 4), N at least 1, with the true poses of the same scans."""
    T_world_odom = T_world_sensor[0] @ se3.inverse(T_odom_sensor[0])
    estimate = T_world_odom @ T_odom_sensor
    return TrajectoryErrors(
        *rpe(estimate, T_world_sensor), ape(estimate, T_world_sensor),
        kitti_drift(estimate, T_world_sensor, lengths_m), float(travelled_m(T_world_sensor)[-1]),
        rotation_error_deg(estimate[-1], T_world_sensor[-1]),
        translation_error_m(estimate[-1], T_world_sensor[-1]), estimate)


def ape(T_estimate: Array, T_truth: Array) -> Array:
    """Return the absolute pose error of each position, (N,) metres, of (N, 4, 4) poses.

    Its root mean square is the ATE. Nothing is aligned.
    """
    return _evo('APE', 'translation_part', T_estimate, T_truth)


def rpe(T_estimate: Array, T_truth: Array) -> tuple[Array, Array]:
    """Return the relative pose error of each pose to the one before, of (N, 4, 4) poses.

    Returns
    -------
    rotation_deg, translation_m : (N - 1,) float64
    """
    if len(T_truth) < 2:
        return np.empty(0), np.empty(0)
    return (_evo('RPE', 'rotation_angle_deg', T_estimate, T_truth),
            _evo('RPE', 'translation_part', T_estimate, T_truth))


def _evo(metric: str, relation: str, T_estimate: Array, T_truth: Array) -> Array:
    try:
        from evo.core import metrics
        from evo.core.trajectory import PosePath3D
    except ImportError as error:
        raise InputError(f'errors of trajectories need evo ({error}): {INSTALL}') from error
    found: Any = getattr(metrics, metric)(metrics.PoseRelation[relation])
    found.process_data(tuple(PosePath3D(poses_se3=list(poses)) for poses in (T_truth, T_estimate)))
    return np.asarray(found.error, np.float64)


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


def kitti_drift(T_estimate: ArrayLike, T_truth: ArrayLike,
                lengths_m: tuple[float, ...] = KITTI_LENGTHS_M) -> Drift:
    """Measure the drift of a trajectory as the KITTI benchmark does.

    From each pose on, each length is travelled along the truth, and the error of the motion over
    that stretch is divided by the length. The benchmark starts at every tenth pose only; here
    every pose starts, so that short trajectories give a figure too. RPE of evo takes the pose that
    is nearest to a length in the place of the first beyond it, and one length at a time.

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
