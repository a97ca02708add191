"""`sgor_kitti_to_bag`: a sequence of SemanticKITTI becomes a bag of labelled clouds."""
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
from ..io.trajectories import read_kitti
from .frame import OK
from .frame import Parser
from .frame import run

CLOUD_TOPIC = '/points'
TRUTH_TOPIC = '/ground_truth'
LIDAR_FRAME = 'lidar'
TRUTH_FRAME = 'odom'
# of rotations in text files
ROUNDING = 1e-2


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
    return OK


def _parser() -> Parser:
    command = Parser(
        'sgor_kitti_to_bag', 'SEQUENCE OUT [options]', 'Write a sequence in the layout of '
        'SemanticKITTI (velodyne/, labels/, times.txt; calib.txt and poses.txt where there are '
        'any) to an mcap bag.',
        ('sgor_kitti_to_bag sequences/08 bags/08',
         'sgor_kitti_to_bag sequences/08 bags/08_predicted --labels predicted_labels'))
    command.add_argument('sequence', type=Path, help='folder of the sequence, such as .../08')
    command.add_argument('out', type=Path, help='folder of the bag, must not exist; it is '
                         'there when it is complete')
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
    try:
        seconds = np.loadtxt(path, ndmin=1)
    except (OSError, ValueError) as error:
        raise InputError(f'{path}: no times: {error}') from error
    if seconds.ndim != 1:
        raise InputError(f'{path}: expected one time a line, got {seconds.shape[1]} numbers')
    _check_length(path, len(seconds), rows)
    used = seconds[rows]
    # stamps of ROS are seconds in 32 bits; nan is neither
    if not ((used >= 0) & (used < 2**31)).all():
        raise InputError(f'{path}: times must be seconds from 0 to 2^31, got '
                         f'{used[~((used >= 0) & (used < 2**31))][0]:g}')
    if (np.diff(used) <= 0).any():
        raise InputError(f'{path}: times must increase; that of scan '
                         f'{rows[int(np.argmax(np.diff(used) <= 0)) + 1]} does not')
    return [round(s * 1e9) for s in used.tolist()]


def _lidar_poses(folder: Path, rows: list[int]) -> NDArray[np.float64] | None:
    """Return (N, 4, 4) poses of the LiDAR relative to the first; None where there are none."""
    path = folder / 'poses.txt'
    if not path.is_file():
        return None
    cameras = read_kitti(path)
    _check_length(path, len(cameras), rows)
    for row in rows:
        _check_rigid(cameras[row], f'{path}: the pose of scan {row}')
    T_camera_lidar = _calibration(folder / 'calib.txt')
    lidars = se3.inverse(T_camera_lidar) @ cameras[rows] @ T_camera_lidar
    return se3.inverse(lidars[0]) @ lidars


def _check_length(path: Path, length: int, rows: list[int]) -> None:
    if length <= max(rows):
        raise InputError(f'{path}: {length} rows, but the scans go up to number {max(rows)}')


def _calibration(path: Path) -> NDArray[np.float64]:
    """Return Tr, which maps points of the LiDAR into the left camera."""
    try:
        rows = dict(line.split(':', 1) for line in path.read_text().splitlines() if ':' in line)
        values = np.array(rows['Tr'].split(), np.float64).reshape(3, 4)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f'{path}: no row Tr of 12 numbers, which the poses need: '
                         f'{error}') from error
    T_camera_lidar = se3.compose(values[:, :3], values[:, 3])
    _check_rigid(T_camera_lidar, f'{path}: Tr')
    return T_camera_lidar


def _check_rigid(T: NDArray[np.float64], what: str) -> None:
    R = T[:3, :3]
    if not np.isfinite(T).all():
        raise InputError(f'{what} is not finite')
    if not np.allclose(R @ R.T, np.eye(3), atol=ROUNDING) or np.linalg.det(R) < 0:
        raise InputError(f'{what} is no rotation and translation')


if __name__ == '__main__':
    sys.exit(main())
