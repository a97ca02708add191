"""`sgor_kitti_to_bag`: a sequence of SemanticKITTI becomes a bag of labelled clouds."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path
import sys

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..core.common import se3
from ..core.common.settings import InputError
from ..io.bags import BagWriter
from ..io.messages import odometry_of
from ..io.messages import point_cloud2
from ..io.scans import read_scan
from ..io.trajectories import read_calibration
from ..io.trajectories import read_poses
from ..io.trajectories import read_times
from .options import parser
from .options import run

CLOUD_TOPIC = '/points'
TRUTH_TOPIC = '/ground_truth'
LIDAR_FRAME = 'lidar'
TRUTH_FRAME = 'odom'


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(convert, _parser().parse_args(argv))


def convert(arguments: Namespace) -> int:
    """Write the bag of a sequence."""
    folder: Path = arguments.sequence
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder')
    scans = _files(folder / 'velodyne', '.bin', None)
    labels = _files(folder / arguments.labels, '.label', scans)
    rows = _rows(scans)
    stamps_ns = _stamps_ns(folder / 'times.txt', rows)
    poses = _lidar_poses(folder, rows)
    with BagWriter(arguments.out) as bag:
        for i, stamp_ns in enumerate(tqdm(stamps_ns, unit='scan', disable=None)):
            scan = read_scan(scans[i], labels[i])
            bag.write(CLOUD_TOPIC, point_cloud2(bag.types, scan.points, scan.labels, stamp_ns,
                                                LIDAR_FRAME), stamp_ns)
            if poses is not None:
                bag.write(TRUTH_TOPIC, odometry_of(bag.types, poses[i], stamp_ns, TRUTH_FRAME,
                                                   LIDAR_FRAME), stamp_ns)
    print(f'{arguments.out}: {len(scans)} clouds on {CLOUD_TOPIC}'
          + (f', poses on {TRUTH_TOPIC}' if poses is not None else ', no poses'))
    return 0


def _parser() -> ArgumentParser:
    command = parser('Write a sequence in the layout of SemanticKITTI (velodyne/, labels/, '
                     'times.txt; calib.txt and poses.txt where there are any) to an mcap bag.')
    command.add_argument('sequence', type=Path, help='folder of the sequence, such as .../08')
    command.add_argument('out', type=Path, help='folder of the bag; must not exist')
    command.add_argument('--labels', default='labels', metavar='FOLDER',
                         help='folder in the sequence with a .label for each scan: labels, '
                         'predicted_labels')
    return command


def _files(folder: Path, suffix: str, partners: list[Path] | None) -> list[Path]:
    """Return the files of a folder in order, the same names as their partners."""
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder')
    files = sorted(folder.glob(f'*{suffix}'))
    if not files:
        raise InputError(f'{folder}: no {suffix} files')
    if partners is None:
        return files
    if missing := sorted({p.stem for p in partners} - {f.stem for f in files}):
        raise InputError(f'{folder}: no labels for {len(missing)} of {len(partners)} scans, the '
                         f'first is {missing[0]}{suffix}')
    return [folder / f'{p.stem}{suffix}' for p in partners]


def _rows(scans: list[Path]) -> list[int]:
    """Return the line of each scan in times.txt and poses.txt, which its name tells.

    So a part of a sequence works with the files of the whole.
    """
    try:
        return [int(path.stem) for path in scans]
    except ValueError as error:
        raise InputError(f'{scans[0].parent}: scans must be named by their number, 000000.bin: '
                         f'{error}') from error


def _stamps_ns(path: Path, rows: list[int]) -> list[int]:
    stamps_ns = read_times(path)
    _check_length(path, len(stamps_ns), rows)
    return [stamps_ns[row] for row in rows]


def _lidar_poses(folder: Path, rows: list[int]) -> NDArray[np.float64] | None:
    """Return (N, 4, 4) poses of the LiDAR relative to the first; None where there are none."""
    path = folder / 'poses.txt'
    if not path.is_file():
        return None
    cameras = read_poses(path)
    _check_length(path, len(cameras), rows)
    T_camera_lidar = read_calibration(folder / 'calib.txt')
    lidars = se3.inverse(T_camera_lidar) @ cameras[rows] @ T_camera_lidar
    return se3.inverse(lidars[0]) @ lidars


def _check_length(path: Path, length: int, rows: list[int]) -> None:
    if length <= max(rows):
        raise InputError(f'{path}: {length} rows, but the scans go up to number {max(rows)}')


if __name__ == '__main__':
    sys.exit(main())
