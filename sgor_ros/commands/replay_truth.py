"""The track of `sgor_replay` against true poses, where they are known."""
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..evaluation.metrics.trajectory import KITTI_LENGTHS_M
from ..evaluation.metrics.trajectory import rmse
from ..evaluation.metrics.trajectory import STRETCHES_M
from ..evaluation.metrics.trajectory import track_errors
from ..evaluation.metrics.trajectory import travelled_m
from ..io.bags import BagReader
from ..io.bags import is_bag
from ..io.sequence import ScanSequence
from ..io.trajectories import read_timed_poses
from ..pipeline.outcome import Row

Array = NDArray[np.float64]
Truth = Sequence[Array | None]

NEAR_S = 0.02
"""A true pose that is farther from a scan in time is not its own."""
WITHOUT_EVO = ("true poses are not compared, which needs evo: pip install "
               "'sgor_ros[evaluation]'")


@dataclass(frozen=True, eq=False)
class GivenTruth:
    """True poses that the user names.

    Attributes
    ----------
    name : str
        The file or the topic.
    stamps_ns : (N,) int64 or None
        Increasing; None where there is a pose for each scan instead.
    poses : (N, 4, 4) float64
    """

    name: str
    stamps_ns: NDArray[np.int64] | None
    poses: Array


def read_truth(name: str, data: Path) -> GivenTruth:
    """Read true poses: of a file, TUM or KITTI, or of a topic of the bag `data`.

    Raises
    ------
    InputError
        A file or a topic that has none.
    """
    if is_bag(data) and not Path(name).exists():
        with BagReader(data) as bag:
            return GivenTruth(name, *bag.timed_poses(name))
    return GivenTruth(name, *read_timed_poses(name))


def true_poses(given: GivenTruth | None, sequence: ScanSequence, rows: Sequence[Row]) -> Truth:
    """Return the true pose of the sensor for each scan, (4, 4), in any one frame.

    Parameters
    ----------
    given : GivenTruth or None
        With stamps: the pose next in time to each scan. None: those that come with the sequence.
    sequence : ScanSequence
    rows : sequence of Row

    Raises
    ------
    InputError
        They are not for these scans.
    """
    if given is None:
        known = sequence.T_world_sensor
        poses: list[Array | None] = [] if known is None else list(known[:len(rows)])
    else:
        poses = (_by_line(given, sequence, rows) if given.stamps_ns is None
                 else _by_time(given.name, given.stamps_ns, given.poses, rows))
    poses += [None] * (len(rows) - len(poses))
    return [None if T is None or np.isnan(T).any() else T for T in poses]


def _by_line(given: GivenTruth, sequence: ScanSequence, rows: Sequence[Row]
             ) -> list[Array | None]:
    expected = len(rows) if sequence.expected is None else sequence.expected
    if len(given.poses) != expected:
        raise InputError(f'--truth {given.name}: {len(given.poses)} poses for {expected} scans; '
                         'in the format of KITTI there is a line for each')
    return list(given.poses[:len(rows)])


def _by_time(name: str, stamps_ns: NDArray[np.int64], listed: Array, rows: Sequence[Row]
             ) -> list[Array | None]:
    scans = np.array([row.stamp_ns for row in rows], np.int64)
    after = np.searchsorted(stamps_ns, scans).clip(1, max(len(stamps_ns) - 1, 1))
    before = after - 1
    after = after.clip(max=len(stamps_ns) - 1)
    nearest = np.where(scans - stamps_ns[before] <= stamps_ns[after] - scans, before, after)
    near = np.abs(stamps_ns[nearest] - scans) <= round(NEAR_S * 1e9)
    if not near.any():
        raise InputError(
            f'--truth {name}: no pose within {NEAR_S:g} s of a scan: it goes from '
            f'{stamps_ns[0] * 1e-9:.3f} to {stamps_ns[-1] * 1e-9:.3f} s, the scans from '
            f'{scans[0] * 1e-9:.3f} to {scans[-1] * 1e-9:.3f} s')
    return [listed[i] if close else None for i, close in zip(nearest, near, strict=True)]


def compared(rows: Sequence[Row], truth: Truth, T_base_sensor: Array
             ) -> tuple[list[dict[str, Any]], dict[int, Array]]:
    """Return the errors of each track, and its true poses (N, 4, 4) in the frame of the track.

    Each is laid on the truth at its first pose, as odometry has it; nothing is fitted.
    """
    T_sensor_base = se3.inverse(T_base_sensor)
    errors: list[dict[str, Any]] = []
    shown: dict[int, Array] = {}
    if find_spec('evo') is None:
        return errors, shown
    for track in dict.fromkeys(row.track_id for row in rows if row.T_odom_child is not None):
        pairs = [(row.T_odom_child, T @ T_sensor_base) for row, T in zip(rows, truth, strict=True)
                 if row.track_id == track and row.T_odom_child is not None and T is not None]
        if len(pairs) < 2:
            continue
        estimate, true = (np.array(poses) for poses in zip(*pairs, strict=True))
        length_m = float(travelled_m(true)[-1])
        found = track_errors(estimate, true, KITTI_LENGTHS_M if length_m > KITTI_LENGTHS_M[0]
                             else STRETCHES_M)
        errors.append({
            'track': track, 'poses': len(pairs), 'length_m': round(length_m, 3),
            'ape_rmse_m': round(rmse(found.ape_m), 4),
            'ape_max_m': round(float(found.ape_m.max()), 4),
            'rpe_translation_rmse_m': round(rmse(found.translation_m), 4),
            'rpe_rotation_rmse_deg': round(rmse(found.rotation_deg), 4),
            'drift_translation_percent': _number(found.drift.translation_percent),
            'drift_rotation_deg_per_m': _number(found.drift.rotation_deg_per_m),
            'drift_stretches': found.drift.stretches})
        shown[track] = estimate[0] @ se3.inverse(true[0]) @ true
    return errors, shown


def in_words(errors: Sequence[dict[str, Any]]) -> list[str]:
    """Return a line for each track."""
    lines = []
    for error in errors:
        which = f'track {error["track"]}: ' if len(errors) > 1 else ''
        drift = ('' if error['drift_translation_percent'] is None else
                 f', drift {error["drift_translation_percent"]:.2f} %')
        lines.append(f'{which}against the truth, {error["poses"]} poses over '
                     f'{error["length_m"]:.1f} m: APE {error["ape_rmse_m"]:.3f} m, RPE '
                     f'{error["rpe_translation_rmse_m"]:.3f} m and '
                     f'{error["rpe_rotation_rmse_deg"]:.3f} deg (RMSE){drift}')
    return lines


def _number(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None
