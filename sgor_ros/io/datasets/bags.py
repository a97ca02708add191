"""The labelled clouds of a bag, in any order."""
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...core.scan.scan import SemanticScan
from ..bags import BagReader
from ..bags import is_bag as recognises
from ..label_field import AUTO
from ..label_field import label_field_of
from ..pointcloud2 import decode
from .drive import Drive
from .drive import Frame

__all__ = ['drives', 'recognises']

TRUTH_TOPIC = '/ground_truth'
"""Of the poses that `sgor_kitti_to_bag` writes."""


def drives(path: Path, name: str) -> list[Drive]:
    """Return a drive for each topic of clouds, or the one of labelled clouds if there is one.

    The bag is read through once for its stamps. Poses are those of odometry on ``/ground_truth``,
    if there is one for each cloud.

    Raises
    ------
    InputError
        A bag that cannot be read, or no clouds in it.
    """
    with BagReader(path) as bag:
        topics = list(bag.cloud_topics())
        if len(topics) != 1:
            try:
                topics = [bag.find_topic(AUTO)]
            except InputError:
                if not topics:
                    raise
        truth = dict(bag.poses(TRUTH_TOPIC))
        return [_drive(bag, topic, name if len(topics) == 1 else f'{name}{topic}', truth)
                for topic in topics]


def _drive(bag: BagReader, topic: str, name: str, truth: dict[int, NDArray[np.float64]]) -> Drive:
    frames, stamps = [], []
    for index, cloud in enumerate(bag.clouds(topic)):
        try:
            stamp_ns = cloud.read()[0]
        except InputError:
            stamp_ns = cloud.bag_time_ns    # `read` of its frame says what is wrong
        frames.append(Frame(f'{name}/{index:06d}', 'bag', SgorConfig().label_convention,
                            partial(_read, bag.path, topic, cloud.bag_time_ns, stamp_ns)))
        stamps.append(stamp_ns)
    ordered = bool((np.diff(stamps) > 0).all())
    known = bool(truth) and all(stamp in truth for stamp in stamps)
    return Drive(name, frames, np.array([truth[stamp] for stamp in stamps]) if known else None,
                 stamps_ns=np.array(stamps, np.int64) if ordered else None)


def _read(path: Path, topic: str, bag_time_ns: int, stamp_ns: int) -> SemanticScan:
    """Read the one cloud that was recorded at a time; the stamp tells it from others."""
    with BagReader(path) as bag:
        found = [cloud.read() for cloud in bag.clouds(topic, bag_time_ns)]
    message = next((each[2] for each in found if each[0] == stamp_ns), found[0][2])
    return decode(message, label_field_of(message, AUTO))
