"""HeLiPR: ``LiDAR/NAME/STAMP.bin`` of four LiDARs, and ``LiDAR_GT/global_NAME_gt.txt``."""
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...core.scan.scan import SemanticScan
from .drive import Drive
from .drive import DriveScan
from .files import files_in
from .names import stamps_of_names

BYTES_A_POINT = {'Ouster': 26, 'Velodyne': 22, 'Avia': 19, 'Aeva': 29}
"""x y z are three float32 at the start of each point; what follows differs."""

AEVA_WITHOUT_INTENSITY = 25
AEVA_CHANGED_NS = 1691936557946849179
"""Scans of the Aeva up to this one are without it."""


def recognises(path: Path) -> bool:
    """Whether a folder is a sequence, or that of one LiDAR in it."""
    return bool(_sensors(path))


def drives(path: Path, name: str) -> list[Drive]:
    """Return a drive for each LiDAR here, named by it where the folder is a sequence."""
    sensors = _sensors(path)
    return [_drive(sensor, name if sensor == path else f'{name}/{sensor.name}')
            for sensor in sensors]


def _sensors(path: Path) -> list[Path]:
    full = path.resolve()
    if full.name in BYTES_A_POINT and full.parent.name == 'LiDAR':
        return [path]
    return [path / 'LiDAR' / name for name in BYTES_A_POINT if (path / 'LiDAR' / name).is_dir()]


def _drive(path: Path, name: str) -> Drive:
    scans = files_in(path, '.bin')
    stamps = stamps_of_names(scans)
    if stamps is None:
        raise InputError(f'{scans[0]}: scans of HeLiPR are named by nanoseconds')
    sensor = path.resolve()
    drive_scans = [DriveScan(f'{name}/{scan.stem}', 'helipr', SgorConfig().label_convention,
                             partial(_read, scan, sensor.name)) for scan in scans]
    table = sensor.parents[1] / f'LiDAR_GT/global_{sensor.name}_gt.txt'
    return Drive(name, drive_scans, _poses(table, stamps) if table.is_file() else None,
                 stamps_ns=stamps)


def _read(path: Path, kind: str) -> SemanticScan:
    step = (AEVA_WITHOUT_INTENSITY if kind == 'Aeva' and int(path.stem) <= AEVA_CHANGED_NS
            else BYTES_A_POINT[kind])
    raw = np.fromfile(path, np.uint8)
    if len(raw) == 0 or len(raw) % step:
        raise InputError(f'{path}: {len(raw)} bytes are no points of {step} bytes each; '
                         f'truncated, or not of the {kind}')
    points = raw.reshape(-1, step)[:, :12].copy().view('<f4')
    try:
        return SemanticScan(points)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def _poses(table: Path, stamps_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the pose of the LiDAR at the stamp of each scan, from the first on."""
    try:
        # stamps are longer than a double is exact
        taken = np.loadtxt(table, np.int64, usecols=0, ndmin=1)
        rows = np.loadtxt(table, usecols=range(1, 8), ndmin=2)
        poses = {int(stamp): se3.compose(Rotation.from_quat(row[3:]).as_matrix(), row[:3])
                 for stamp, row in zip(taken, rows, strict=True)}
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f'{table}: expected stamp x y z qx qy qz qw a line: {error}') from error
    if missing := [stamp for stamp in stamps_ns.tolist() if stamp not in poses]:
        raise InputError(f'{table}: no pose for {len(missing)} of {len(stamps_ns)} scans, the '
                         f'first is {missing[0]}')
    T = np.array([poses[stamp] for stamp in stamps_ns.tolist()])
    return np.asarray(se3.inverse(T[0]) @ T)
