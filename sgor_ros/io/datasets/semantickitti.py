"""KITTI odometry and SemanticKITTI: a folder ``velodyne``, and what lies beside it."""
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ..scans import read_scan
from .drive import Drive
from .drive import DriveScan
from .files import calibration
from .files import files_in
from .files import partners_in
from .files import read_poses
from .files import read_times

LABEL_FOLDERS = {'labels': 'semantickitti', 'predicted_labels': 'semantickitti_train'}
"""Where labels lie beside `velodyne`, best first, and what 32-bit ids there mean."""

BYTES_PER_POINT = 16


def recognises(path: Path) -> bool:
    """Whether a folder is a sequence."""
    return (path / 'velodyne').is_dir()


def drives(path: Path, name: str, labels: str | Path | None = None) -> list[Drive]:
    """Return the one drive of a sequence, with those labels or the best that each scan has."""
    return [sequence(path, name, labels)]


def sequence(path: Path, name: str, labels: str | Path | None = None) -> Drive:
    """Read a sequence.

    Parameters
    ----------
    path : Path
        Holds ``velodyne/*.bin``; beside it there may be folders of labels, ``times.txt``, and
        ``poses.txt`` or, as KITTI has it, ``../../poses/08.txt``. Poses are of the camera that
        ``Tr`` of ``calib.txt`` maps the LiDAR to; where there is no calib.txt, of the LiDAR.
    name : str
    labels : str or Path, optional
        Folder with a ``.label`` for each scan, here or anywhere; without it each scan has the
        best there is.

    Raises
    ------
    InputError
        Something is missing, cannot be read, or is not for these scans.
    """
    scans = files_in(path / 'velodyne', '.bin')
    chosen = ([best_labels(scan) for scan in scans] if labels is None
              else partners_in(labels, path, scans))
    drive_scans = [drive_scan(scan, its, f'{name}/{scan.stem}')
              for scan, its in zip(scans, chosen, strict=True)]
    stamps = read_times(path / 'times.txt', scans) if (path / 'times.txt').is_file() else None
    return Drive(name, drive_scans, _poses(path, scans), drive_scans[0].data_set != 'nuscenes',
                 stamps)


def _poses(path: Path, scans: list[Path]) -> NDArray[np.float64] | None:
    own = path / 'poses.txt'
    if own.is_file():
        return read_poses(own, scans, calibration(path))
    full = path.resolve()
    shared = full.parents[1] / f'poses/{full.name}.txt'
    return read_poses(shared, scans, path / 'calib.txt') if shared.is_file() else None


def drive_scan(scan: Path, labels: Path | None, name: str) -> DriveScan:
    """Describe a scan in files; what its labels mean follows from their folder and size."""
    convention = SgorConfig().label_convention
    if labels is not None and labels.is_file():
        one_byte = labels.stat().st_size * BYTES_PER_POINT == scan.stat().st_size
        convention = 'nuscenes' if one_byte else LABEL_FOLDERS.get(labels.parent.name, convention)
    data_set = 'nuscenes' if convention == 'nuscenes' else 'kitti'
    return DriveScan(name, data_set, convention, partial(read_scan, scan, labels))


def best_labels(scan: Path) -> Path | None:
    """Return the labels of a scan, by hand before predicted ones; None where it has none."""
    candidates = (scan.parents[1] / folder / f'{scan.stem}.label' for folder in LABEL_FOLDERS)
    return next((path for path in candidates if path.is_file()), None)


# its name before: evaluation still says so
frame = drive_scan
