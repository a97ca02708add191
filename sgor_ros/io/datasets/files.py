"""What the layouts have in common: files in order, and tables with a row for each scan."""
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from .. import trajectories
from .names import in_order

Array = NDArray[np.float64]

NOT_RIGID = 1e-3
"""Poses are written with some digits only; a matrix farther from a rotation is none."""


def files_in(folder: Path, suffix: str) -> list[Path]:
    """Return the files of a folder in order.

    Raises
    ------
    InputError
        No such folder, or none in it.
    """
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder')
    files = in_order([path for path in folder.glob(f'*{suffix}') if path.is_file()])
    if not files:
        raise InputError(f'{folder}: no {suffix} files')
    return files


def partners(folder: Path, suffix: str, scans: Sequence[Path]) -> list[Path]:
    """Return the file of each scan in another folder, of the same name.

    Raises
    ------
    InputError
        No such folder, or a scan without one.
    """
    files_in(folder, suffix)
    found = [folder / f'{scan.stem}{suffix}' for scan in scans]
    if missing := [path.name for path in found if not path.is_file()]:
        raise InputError(f'{folder}: no labels for {len(missing)} of {len(scans)} scans, the '
                         f'first is {missing[0]}')
    return found


def partners_in(labels: str | Path, beside: Path, scans: Sequence[Path]) -> list[Path]:
    """Return the labels of each scan in a folder that a user names, as a path or `beside` them.

    Raises
    ------
    InputError
        As of `partners`.
    """
    own = beside / labels
    return partners(own if own.is_dir() or not Path(labels).is_dir() else Path(labels), '.label',
                    scans)


def rows_of(table: Path, count: int, scans: Sequence[Path]) -> list[int]:
    """Return the row of each scan in a table of `count` rows.

    As many rows as scans: in the order of the scans. Else the number of a scan is that of its row,
    so that a part of a sequence works with the tables of the whole.

    Raises
    ------
    InputError
        Neither is possible.
    """
    if count == len(scans):
        return list(range(count))
    if not all(scan.stem.isdecimal() for scan in scans):
        raise InputError(f'{table}: {count} rows for {len(scans)} scans, whose names are no '
                         'numbers of rows')
    numbers = [int(scan.stem) for scan in scans]
    if count <= max(numbers):
        raise InputError(f'{table}: {count} rows for {len(scans)} scans, which go up to number '
                         f'{max(numbers)}')
    return numbers


def read_times(path: Path, scans: Sequence[Path]) -> NDArray[np.int64]:
    """Read seconds, one a line, as the stamps of scans in nanoseconds.

    Raises
    ------
    InputError
        No such file, other than one number a line, or times that do not increase.
    """
    stamps_ns = trajectories.read_times(path)
    return np.array([stamps_ns[row] for row in rows_of(path, len(stamps_ns), scans)], np.int64)


def read_poses(path: Path, scans: Sequence[Path], calibration: Path | None = None) -> Array:
    """Read the poses of the LiDAR, (N, 4, 4), from a file of KITTI's format.

    Parameters
    ----------
    path : Path
        Of a camera where there is a calibration, else of the LiDAR.
    scans : sequence of Path
    calibration : Path, optional
        File whose ``Tr`` maps points of the LiDAR into that camera.

    Raises
    ------
    InputError
        A file that is none, counts that differ, or rows that are no rigid motions.
    """
    poses = trajectories.read_kitti(path)
    poses = poses[rows_of(path, len(poses), scans)]
    check_rigid(path, poses)
    if calibration is None:
        return poses
    T_camera_sensor = trajectories.read_calibration(calibration)
    return np.asarray(se3.inverse(T_camera_sensor) @ poses @ T_camera_sensor)


def calibration(folder: Path) -> Path | None:
    """Return the calib.txt of a folder, if it has one."""
    path = folder / 'calib.txt'
    return path if path.is_file() else None


def check_rigid(path: Path, T: Array) -> None:
    """Refuse (N, 4, 4) matrices that are no turns and shifts, such as nan or all zero."""
    finite = np.isfinite(T).all(axis=(1, 2))
    turn = np.where(finite[:, None, None], T, 0)[:, :3, :3]
    off = np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    good = (off < NOT_RIGID) & (np.linalg.det(turn) > 0) & finite
    if not good.all():
        raise InputError(f'{path}: the pose of scan {np.flatnonzero(~good)[0]} is no rotation and '
                         'translation')
