"""Trajectories in the formats of TUM and KITTI."""
from collections.abc import Iterable
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common.settings import InputError

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
    """Read poses of KITTI's format as (N, 4, 4).

    Raises
    ------
    InputError
        No such file, or lines of other than 12 numbers.
    """
    try:
        rows = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f'{path}: no poses: {error}') from error
    if rows.shape[1:] != (12,):
        raise InputError(f'{path}: expected 12 numbers a line, got {rows.shape[-1]}')
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    return poses


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(f'{value:.9f}' for value in values)
