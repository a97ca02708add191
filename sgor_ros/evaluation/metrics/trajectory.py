"""Errors of trajectories: APE and RPE by evo, drift as the KITTI benchmark has it."""
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError

Array = NDArray[np.float64]

KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Lengths over which the KITTI benchmark measures drift."""
STRETCHES_M = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
"""Lengths for the drift of a drive that is too short for those of KITTI."""


def require_evo() -> None:
    """Refuse to go on without evo, before anything is measured.

    Raises
    ------
    InputError
        It tells what to install.
    """
    if find_spec('evo') is None:
        raise InputError("the errors of trajectories need evo: pip install 'sgor_ros[evaluation]'")


def ape(T_estimate: ArrayLike, T_truth: ArrayLike) -> tuple[Array, Array]:
    """Return the absolute pose error (APE, ATE), degrees and metres, (N,) each; not aligned."""
    from evo.core.metrics import APE
    return _by_evo(APE, T_estimate, T_truth)


def rpe(T_estimate: ArrayLike, T_truth: ArrayLike) -> tuple[Array, Array]:
    """Return the relative pose error from pose to pose, degrees and metres, (N - 1,) each."""
    from evo.core.metrics import RPE
    if len(np.asarray(T_truth)) < 2:
        return np.empty(0), np.empty(0)
    return _by_evo(RPE, T_estimate, T_truth)


def _by_evo(metric: Any, T_estimate: ArrayLike, T_truth: ArrayLike) -> tuple[Array, Array]:
    """Return a metric of evo for the angle and the translation of the error."""
    from evo.core.metrics import PoseRelation
    from evo.core.trajectory import PosePath3D
    paths = tuple(PosePath3D(poses_se3=list(np.asarray(poses, np.float64)))
                  for poses in (T_truth, T_estimate))
    turned, moved = metric(PoseRelation.full_transformation), metric(PoseRelation.translation_part)
    for each in (turned, moved):
        each.process_data(paths)
    # evo's own angle refuses rotations that were rounded in a file
    angles = [np.rad2deg(se3.angle(error[:3, :3])) for error in turned.E]
    return np.array(angles), np.asarray(moved.error, np.float64)


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


def rmse(errors: Array) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def travelled_m(T_world_sensor: ArrayLike) -> Array:
    """Return the (N,) way travelled up to each of (N, 4, 4) poses, metres."""
    positions = np.asarray(T_world_sensor, np.float64)[:, :3, 3]
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def drift(T_estimate: ArrayLike, T_truth: ArrayLike,
          lengths_m: tuple[float, ...] = KITTI_LENGTHS_M) -> Drift:
    """Measure the drift of a trajectory as the KITTI benchmark does.

    From each pose on, each length is travelled along the truth, and the error of the motion over
    that stretch is divided by the length. The benchmark starts at every tenth pose only; here
    every pose starts, so that short trajectories give a figure too.

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


@dataclass(frozen=True, eq=False)
class TrackErrors:
    """Errors of a track.

    Attributes
    ----------
    ape_m : (N,) float64
        Absolute pose error, the translation of it.
    rotation_deg, translation_m : (N - 1,) float64
        Relative pose error: RE and TE of each pose relative to the one before.
    drift : Drift
    length_m : float
        Way travelled along the truth.
    end_rotation_deg, end_translation_m : float
        Error of the last pose, relative to the first.
    estimate : (N, 4, 4) float64
        The track in the frame of the truth, laid on it at the first pose.
    """

    ape_m: Array
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
    off_deg, off_m = ape(estimate, T_world_sensor)
    return TrackErrors(off_m, *rpe(estimate, T_world_sensor),
                       drift(estimate, T_world_sensor, lengths_m),
                       float(travelled_m(T_world_sensor)[-1]), float(off_deg[-1]),
                       float(off_m[-1]), estimate)
