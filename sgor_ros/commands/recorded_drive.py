"""A recorded drive as clouds with true poses, to be played to the node."""
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from ..core.common import se3
from ..core.common.settings import InputError
from ..io.datasets import Drive
from ..io.datasets import open_drive
from ..io.messages import point_cloud2
from .world_bag import FIRST_STAMP_NS
from .world_bag import WorldMap

PERIOD_NS = 100_000_000
# of the points of every so many scans, every so many are the map
MAP_SCANS, MAP_POINTS = 4, 20
# raw SemanticKITTI ids that the picture knows: "other" for what has no label
OTHER = 99


@dataclass(frozen=True, eq=False)
class Recorded:
    """Scans of a drive, 0.1 s apart.

    Attributes
    ----------
    truth : dict of int to (4, 4) float64
        Stamp in nanoseconds to T_world_sensor.
    clouds : list
        PointCloud2 of each; without a label field where the drive has no labels.
    world : WorldMap
    label_convention : str
    """

    truth: dict[int, NDArray[np.float64]]
    clouds: list[Any]
    world: WorldMap
    label_convention: str


def recorded_drive(folder: Path, most: int) -> Recorded:
    """Read up to `most` scans of a folder that `open_drive` knows, with poses.

    Raises
    ------
    InputError
        There is no such drive, or several, or it has no poses or fewer than two scans.
    """
    drive = open_drive(folder)
    if drive.T_world_sensor is None:
        raise InputError(f'--data {folder}: no poses.txt, and so no truth to compare with')
    if len(drive.scans) < 2:
        raise InputError(f'--data {folder}: at least 2 scans')
    types = get_typestore(Stores.ROS2_JAZZY).types.__getitem__
    truth: dict[int, NDArray[np.float64]] = {}
    clouds, seen = [], []
    for stamp_ns, points, labels, pose in _scans(drive, most):
        clouds.append(point_cloud2(types, points, labels, stamp_ns, 'lidar'))
        if len(truth) % MAP_SCANS == 0:
            classes = np.full(len(points), OTHER, np.uint32) if labels is None else labels
            seen.append((se3.transform(pose, points[::MAP_POINTS].astype(np.float64)),
                         classes[::MAP_POINTS].astype(np.uint32)))
        truth[stamp_ns] = pose
    world = WorldMap(*(np.concatenate(parts) for parts in zip(*seen, strict=True)))
    return Recorded(truth, clouds, world, drive.label_convention)


def _scans(drive: Drive, most: int) -> Iterator[tuple[int, Any, Any, NDArray[np.float64]]]:
    assert drive.T_world_sensor is not None
    pairs = zip(drive.scans[:most], drive.T_world_sensor, strict=False)
    for i, (recorded, pose) in enumerate(pairs):
        scan = recorded.read()
        yield FIRST_STAMP_NS + i * PERIOD_NS, scan.points, scan.labels, pose
