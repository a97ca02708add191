"""`sgor_kitti_to_bag`: a sequence of SemanticKITTI becomes a bag of labelled clouds."""
from argparse import Namespace
from pathlib import Path
import sys

from ..core.common import se3
from ..core.common.settings import InputError
from ..io.bags import BagWriter
from ..io.datasets import semantickitti
from ..io.messages import odometry_of
from ..io.messages import point_cloud2
from ..io.terminal import progress
from ..io.trajectories import read_calibration
from .command_line import OK
from .command_line import Parser
from .command_line import run

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
    drive = semantickitti.sequence(folder, folder.resolve().name, arguments.labels)
    if drive.stamps_ns is None:
        raise InputError(f'{folder}/times.txt: no such file, which a bag needs')
    poses = drive.T_world_sensor
    if poses is not None:
        read_calibration(folder / 'calib.txt')    # without one they would be taken for the LiDAR's
        poses = se3.inverse(poses[0]) @ poses
    with (BagWriter(arguments.out) as bag,
          progress(drive.name, len(drive), 'scan') as told):
        for i, stamp_ns in enumerate(told.over(drive.stamps_ns.tolist())):
            scan = drive.read(i)
            bag.write(CLOUD_TOPIC, point_cloud2(bag.types, scan.points, scan.labels, stamp_ns,
                                                LIDAR_FRAME), stamp_ns)
            if poses is not None:
                bag.write(TRUTH_TOPIC, odometry_of(bag.types, poses[i], stamp_ns, TRUTH_FRAME,
                                                   LIDAR_FRAME), stamp_ns)
    print(f'{arguments.out}: {len(drive)} clouds on {CLOUD_TOPIC}'
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


if __name__ == '__main__':
    sys.exit(main())
