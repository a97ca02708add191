"""A folder of scans of any kind that `read_scan` takes, with or without poses."""
from functools import partial
from pathlib import Path

from ...core.config import SgorConfig
from ..scans import read_scan
from ..scans import READERS
from .drive import Drive
from .drive import DriveScan
from .files import calibration
from .files import partners_in
from .files import read_poses
from .files import read_times
from .names import in_order
from .names import stamps_of_names


def recognises(path: Path) -> bool:
    """Whether a folder holds scans."""
    return bool(_scans(path))


def drives(path: Path, name: str, labels: str | Path | None = None) -> list[Drive]:
    """Return the one drive of a folder.

    Labels are in the scans themselves or, beside ``a.bin``, in ``a.label``; ``poses.txt`` are
    those of the LiDAR, ``times.txt`` its seconds; scans may be named by their nanoseconds.
    """
    scans = _scans(path)
    own = ([_labels_beside(scan) for scan in scans] if labels is None
           else partners_in(labels, path, scans))
    drive_scans = [DriveScan(f'{name}/{scan.stem}', 'scans', SgorConfig().label_convention,
                             partial(read_scan, scan, its))
                   for scan, its in zip(scans, own, strict=True)]
    times, poses = path / 'times.txt', path / 'poses.txt'
    return [Drive(name, drive_scans,
                  read_poses(poses, scans, calibration(path)) if poses.is_file() else None,
                  stamps_ns=read_times(times, scans) if times.is_file()
                  else stamps_of_names(scans))]


def _labels_beside(scan: Path) -> Path | None:
    labels = scan.with_suffix('.label')
    return labels if labels.is_file() else None


def _scans(path: Path) -> list[Path]:
    return in_order([file for file in path.iterdir()
                     if file.suffix.lower() in READERS and file.is_file()])
