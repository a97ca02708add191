"""Drives that come back: recorded ones, whose other scans return turned round."""
from dataclasses import replace
from functools import partial

import numpy as np

from ...core.common import se3
from ...core.scan.scan import SemanticScan
from ...io.datasets import Drive
from ...io.datasets import DriveScan

STANDSTILL_NS = 2_000_000_000
"""Before it returns, so that a turn of any size is a possible motion."""


def there_and_back(drive: Drive, yaw: float) -> Drive:
    """Return every second scan of a drive, then the others from its end on, turned to the left.

    No scan meets itself.

    Parameters
    ----------
    drive : Drive
    yaw : float
        By which the sensor is turned on the way back, rad.
    """
    assert drive.T_world_sensor is not None
    stamps_ns = [scan.stamp_ns for scan in drive]
    count = len(drive)
    there, back = list(range(0, count, 2)), list(range(count - 1 - count % 2, 0, -2))
    turn = se3.compose(se3.rotations(np.array([0, 0, yaw])), np.zeros(3))
    end_ns = stamps_ns[-1] + STANDSTILL_NS
    return Drive(
        f'{drive.name} there and back',
        [*(drive.scans[i] for i in there), *(_turned(drive.scans[i], yaw) for i in back)],
        np.concatenate([drive.T_world_sensor[there], drive.T_world_sensor[back] @ turn]),
        drive.heights_known,
        np.array([*(stamps_ns[i] for i in there),
                  *(end_ns + stamps_ns[-1] - stamps_ns[i] for i in back)], np.int64))


def _turned(scan: DriveScan, yaw: float) -> DriveScan:
    return replace(scan, read=partial(_read_turned, scan, yaw))


def _read_turned(scan: DriveScan, yaw: float) -> SemanticScan:
    read = scan.read()
    R = se3.rotations(np.array([0, 0, -yaw]))
    return SemanticScan((read.points @ R.T).astype(np.float32), read.labels)
