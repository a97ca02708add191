"""MulRan: ``Ouster/STAMP.bin``, and ``global_pose.csv`` of the vehicle."""
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ..scans import read_scan
from .drive import Drive
from .drive import DriveScan
from .files import check_rigid
from .files import files_in
from .names import stamps_of_names

T_BASE_SENSOR = se3.compose(
    Rotation.from_euler('xyz', [0.0001, 0.0003, 179.6654], degrees=True).as_matrix(),
    np.array([1.7042, -0.021, 1.8047]))
"""``calib_base2ouster.txt``, which is the same for all sequences."""

FARTHEST_NS = 100_000_000
"""A pose that is farther from its scan in time is not its own."""


def recognises(path: Path) -> bool:
    """Whether a folder is a sequence."""
    # HeLiPR has a folder of that name, too
    return path.name != 'LiDAR' and _scans(path).is_dir()


def drives(path: Path, name: str) -> list[Drive]:
    """Return the one drive of a sequence; without ``global_pose.csv`` it has no poses."""
    scans = files_in(_scans(path), '.bin')
    stamps = stamps_of_names(scans)
    if stamps is None:
        raise InputError(f'{scans[0]}: scans of MulRan are named by nanoseconds')
    drive_scans = [DriveScan(f'{name}/{scan.stem}', 'mulran', SgorConfig().label_convention,
                    partial(read_scan, scan)) for scan in scans]
    table = path / 'global_pose.csv'
    poses = _poses(table, stamps) if table.is_file() else None
    return [Drive(name, drive_scans, poses, stamps_ns=stamps)]


def _scans(path: Path) -> Path:
    plain = path / 'Ouster'
    return plain if plain.is_dir() else path / 'sensor_data/Ouster'


def _poses(table: Path, stamps_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the pose of the LiDAR that is next to each scan in time, from the first on.

    Those in the file are in UTM, where a float32 has half a metre.
    """
    try:
        # stamps are longer than a double is exact
        taken = np.loadtxt(table, np.int64, delimiter=',', usecols=0, ndmin=1)
        rows = np.loadtxt(table, delimiter=',', usecols=range(1, 13), ndmin=2)
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f'{table}: expected a stamp and 12 numbers a line: {error}') from error
    vehicle = np.tile(np.eye(4), (len(rows), 1, 1))
    vehicle[:, :3] = rows.reshape(-1, 3, 4)
    check_rigid(table, vehicle)
    nearest = np.abs(taken[:, None] - stamps_ns).argmin(axis=0)
    far = np.flatnonzero(np.abs(taken[nearest] - stamps_ns) > FARTHEST_NS)
    if far.size:
        raise InputError(f'{table}: no pose within {FARTHEST_NS * 1e-9:g} s of scan '
                         f'{stamps_ns[far[0]]}')
    return np.asarray(se3.inverse(vehicle[nearest[0]]) @ vehicle[nearest] @ T_BASE_SENSOR)
