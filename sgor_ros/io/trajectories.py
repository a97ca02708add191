"""Trajectories in the formats of TUM and KITTI."""
from collections.abc import Iterable
from collections.abc import Sequence
from decimal import Decimal
import io
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common import se3
from ..core.common.settings import InputError
from .broken import readable

LATEST_S = 2.0**31
"""What a stamp of ROS holds."""
ROUNDING = 0.01
"""How far R R^T may be from 1 in a file of few digits."""
FARTHEST_M = 1e9
"""Metres, around the earth and beyond."""

Pose = NDArray[np.float64]


def write_tum(path: str | Path, stamps_ns: Sequence[int], poses: Sequence[Pose | None]) -> None:
    """Write ``seconds x y z qx qy qz qw`` a line; scans without a pose have none."""
    with open(path, 'w') as file:
        for stamp_ns, T in zip(stamps_ns, poses, strict=True):
            if T is not None:
                values = (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat())
                seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
                file.write(f'{seconds}.{nanoseconds:09d} {_numbers(values)}\n')


def write_kitti(path: str | Path, poses: Sequence[Pose | None]) -> None:
    """Write the upper three rows of each pose in one line.

    The format knows scans by their line, so that of a scan without a pose is all ``nan``.
    """
    with open(path, 'w') as file:
        for T in poses:
            file.write(_numbers(np.full(12, np.nan) if T is None else T[:3].reshape(-1)) + '\n')


def read_kitti(path: str | Path) -> NDArray[np.float64]:
    """Read poses of KITTI's format as (N, 4, 4); a line that is all ``nan`` stays so.

    Raises
    ------
    InputError
        No such file, lines of other than 12 numbers, or one that is neither a rotation and a
        translation nor all ``nan``.
    """
    rows = _rows(path)
    if rows.shape[1:] != (12,):
        raise InputError(f'{path}: expected 12 numbers a line, got {rows.shape[-1]}')
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    bad = np.flatnonzero(~(_is_rigid(poses) | np.isnan(rows).all(axis=1)))
    if bad.size:
        row = rows[bad[0]]
        what = 'no rotation and translation' if np.isfinite(row).all() else 'not finite'
        raise InputError(f'{path}: the pose of scan {bad[0]} is {what}: {_short(row)}')
    return poses


def read_poses(path: str | Path) -> NDArray[np.float64]:
    """Read poses as `read_kitti` does, none of which may be missing.

    Raises
    ------
    InputError
        As of `read_kitti`, or a line of ``nan``.
    """
    poses = read_kitti(path)
    missing = np.flatnonzero(np.isnan(poses[:, 0, 0]))
    if missing.size:
        raise InputError(f'{path}: the pose of scan {missing[0]} is not finite')
    return poses


def read_timed_poses(path: str | Path) -> tuple[NDArray[np.int64] | None, NDArray[np.float64]]:
    """Read poses of the format of TUM or of KITTI: by their columns, 8 or 12.

    Returns
    -------
    stamps_ns : (N,) int64 or None
        Nanoseconds, increasing; None in the format of KITTI.
    poses : (N, 4, 4) float64

    Raises
    ------
    InputError
        As of `read_kitti`; stamps that are none or do not increase; quaternions that are none.
    """
    rows = _rows(path)
    if rows.shape[1] == 12:
        return None, read_kitti(path)
    if rows.shape[1] != 8:
        raise InputError(f'{path}: {rows.shape[1]} numbers a line; expected 8 (TUM: seconds x y z '
                         'qx qy qz qw) or 12 (KITTI)')
    seconds, length = rows[:, 0], np.linalg.norm(rows[:, 4:], axis=1)
    good = ((seconds >= 0) & (seconds < LATEST_S) & (np.abs(length - 1) < ROUNDING)
            & (np.abs(rows[:, 1:4]).max(axis=1) < FARTHEST_M))
    good[1:] &= np.diff(seconds) > 0
    if not good.all():
        bad = int(np.flatnonzero(~good)[0])
        raise InputError(f'{path}: line {bad + 1} of numbers is no later time with a pose: '
                         f'{_short(rows[bad])}')
    # as text: a double holds the microseconds of a date only
    return _nanoseconds(path), se3.compose(Rotation.from_quat(rows[:, 4:]).as_matrix(),
                                           rows[:, 1:4])


def _nanoseconds(path: str | Path) -> NDArray[np.int64]:
    # lines as numpy has them: splitlines also ends them at form feeds and the like
    first = (line.split('#')[0].split() for line in Path(path).read_text().split('\n'))
    return np.array([int(Decimal(words[0]) * 10**9) for words in first if words], np.int64)


def read_times(path: str | Path) -> list[int]:
    """Read times, a line of seconds each as in KITTI, as nanoseconds.

    Raises
    ------
    InputError
        No such file, other than one number a line, or one that is no time or not later than that
        before it.
    """
    rows = _rows(path)
    if rows.shape[1:] != (1,):
        raise InputError(f'{path}: expected one number a line, got {rows.shape[-1]}')
    seconds = rows[:, 0]
    bad = np.flatnonzero(~((seconds >= 0) & (seconds < LATEST_S)))
    if bad.size:
        raise InputError(f'{path}: time {bad[0]} is {seconds[bad[0]]:g} s; expected 0 to 2^31')
    stamps_ns = [round(s * 1e9) for s in seconds.tolist()]
    for i, (before, stamp_ns) in enumerate(pairwise(stamps_ns), 1):
        if stamp_ns <= before:
            raise InputError(f'{path}: time {i}, {stamp_ns / 1e9:g} s, is not later than the one '
                             f'before it, {before / 1e9:g} s')
    return stamps_ns


def read_calibration(path: str | Path) -> NDArray[np.float64]:
    """Read Tr of KITTI's calib.txt as (4, 4): it maps points of the LiDAR into the left camera.

    Raises
    ------
    InputError
        No such file or row, or one that is no rotation and translation.
    """
    with readable(path):
        rows = dict(line.split(':', 1) for line in Path(path).read_text().splitlines()
                    if ':' in line)
        if 'Tr' not in rows:
            raise InputError(f'{path}: no row Tr, which the poses need')
        values = np.array(rows['Tr'].split(), np.float64)
    if values.shape != (12,):
        raise InputError(f'{path}: Tr has {values.size} numbers; expected 12')
    T = np.vstack((values.reshape(3, 4), (0.0, 0.0, 0.0, 1.0)))
    if not _is_rigid(T[None])[0]:
        raise InputError(f'{path}: Tr is no rotation and translation: {_short(values)}')
    return T


def _rows(path: str | Path) -> NDArray[np.float64]:
    """Return the numbers of a file, those of a line in a row."""
    with readable(path):
        text = Path(path).read_text()
        if not text.strip():
            raise InputError(f'{path}: it is empty')
        return np.loadtxt(io.StringIO(text), ndmin=2)


def _is_rigid(T: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of (N, 4, 4) are motions, as exactly as text files are."""
    R = T[:, :3, :3]
    with np.errstate(all='ignore'):    # they may be anything
        off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        rigid: NDArray[np.bool_] = (off < ROUNDING) & (np.linalg.det(R) > 0) & (
            np.abs(T[:, :3, 3]).max(axis=1) < FARTHEST_M)
    return rigid


def _short(values: NDArray[np.float64]) -> str:
    return ' '.join(f'{value:.3g}' for value in values)


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(f'{value:.9f}' for value in values)
