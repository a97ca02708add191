"""RELLIS-3D, its Ouster OS1: as SemanticKITTI, with folders of other names."""
from functools import partial
from pathlib import Path

from ..scans import read_scan
from .drive import Drive
from .drive import DriveScan
from .files import calibration
from .files import files_in
from .files import read_poses

SCANS, LABELS = 'os1_cloud_node_kitti_bin', 'os1_cloud_node_semantickitti_label_id'


def recognises(path: Path) -> bool:
    """Whether a folder is a sequence."""
    return (path / SCANS).is_dir()


def drives(path: Path, name: str) -> list[Drive]:
    """Return the one drive of a sequence; ``poses.txt`` is turned by ``calib.txt``, if there."""
    scans = files_in(path / SCANS, '.bin')
    drive_scans = []
    for scan in scans:
        labels = path / LABELS / f'{scan.stem}.label'
        drive_scans.append(DriveScan(f'{name}/{scan.stem}', 'rellis', 'rellis', partial(
            read_scan, scan, labels if labels.is_file() else None)))
    poses = path / 'poses.txt'
    return [Drive(name, drive_scans, read_poses(poses, scans, calibration(path))
                  if poses.is_file() else None)]
