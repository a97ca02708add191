"""The labelled clouds of a bag: one after the other, or in any order."""
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from functools import partial
from itertools import islice
import os
from pathlib import Path
import threading
from typing import Any
import weakref

import numpy as np
from numpy.typing import NDArray

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...core.scan.scan import SemanticScan
from ..bags import BagReader
from ..bags import is_bag as recognises
from ..bags import RecordedCloud
from ..label_field import AUTO
from ..sequence import scan_of_cloud
from ..sequence import StampedScan
from .drive import Drive
from .drive import DriveScan

__all__ = ['BagSequence', 'drives', 'recognises']

TRUTH_TOPIC = '/ground_truth'
"""Of the poses that `sgor_kitti_to_bag` writes."""


class BagSequence:
    """The clouds of one topic of an open bag, in the order of recording: a `ScanSequence`.

    Parameters
    ----------
    bag : BagReader
        Open as long as the sequence is iterated over.
    topic : str
    label_field : str
        As `label_field_of` takes it.
    time_field : str
        As `time_field_of` takes it.

    Attributes
    ----------
    name : str
        The topic.
    expected : int
        How many clouds the bag claims to have.
    label_convention : None
        No bag tells.
    warnings : tuple of str

    Raises
    ------
    InputError
        No such topic of clouds. While iterating: a bag that breaks off.
    """

    def __init__(self, bag: BagReader, topic: str, label_field: str = AUTO,
                 time_field: str = AUTO) -> None:
        self.name = topic
        self.expected = bag.count(topic)
        self.label_convention = None
        self._bag = bag
        self._label_field = label_field
        self._time_field = time_field
        first = [_scan_of(cloud, label_field, time_field).stamp_ns
                 for cloud in islice(bag.clouds(topic), 2)]
        self._stampless = first == [0, 0]
        self.warnings = (('the clouds have no stamps (all are zero): the times of their recording '
                          'serve',) if self._stampless else ())

    def __iter__(self) -> Iterator[StampedScan]:
        """Iterate over the scans; reading one whose message is broken raises InputError."""
        for cloud in self._bag.clouds(self.name):
            scan = _scan_of(cloud, self._label_field, self._time_field)
            # a cloud that has one all the same, or is broken, is not another's
            yield scan if scan.stamp_ns or not self._stampless else replace(
                scan, stamp_ns=cloud.bag_time_ns)

    @cached_property
    def T_world_sensor(self) -> NDArray[np.float64] | None:
        """Poses of odometry on ``/ground_truth``, if there is one for each cloud.

        The bag is read through for its stamps.
        """
        return _true_poses(self._bag, [scan.stamp_ns for scan in self])


class _OpenBag:
    """A bag for random access: opened at the first use, and open until it is forgotten.

    Threads take turns; a forked or unpickled one opens the bag for itself.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._reader: BagReader | None = None
        self._process = 0

    def __reduce__(self) -> tuple[Any, ...]:
        return _OpenBag, (self._path,)

    def reader(self) -> BagReader:
        """Return the open bag."""
        if self._reader is None or self._process != os.getpid():
            self._reader = BagReader(self._path).__enter__()
            self._process = os.getpid()
            weakref.finalize(self, self._reader.__exit__, None, None, None)
        return self._reader

    def read(self, topic: str, recorded_ns: int, stamp_ns: int) -> SemanticScan:
        """Return the one scan that was recorded at a time; the stamp tells it from others."""
        with self._lock:
            for cloud in self.reader().clouds(topic, recorded_ns):
                scan = _scan_of(cloud, AUTO, AUTO)
                if scan.stamp_ns in (stamp_ns, 0):    # of the zeros, times of recording are told
                    return scan.read()
        raise InputError(f'{self._path}: the cloud of {topic} at {stamp_ns} is gone')


def drives(path: Path, name: str) -> list[Drive]:
    """Return a drive for each topic of clouds, or the one of labelled clouds if there is one.

    The bag is read through once for its stamps. Poses are those of odometry on ``/ground_truth``,
    if there is one for each cloud.

    Raises
    ------
    InputError
        A bag that cannot be read, or no clouds in it.
    """
    bag = _OpenBag(path)
    topics = list(bag.reader().cloud_topics())
    if len(topics) != 1:
        try:
            topics = [bag.reader().find_topic(AUTO)]
        except InputError:
            if not topics:
                raise
    return [_drive(bag, topic, name if len(topics) == 1 else f'{name}{topic}')
            for topic in topics]


def _drive(bag: _OpenBag, topic: str, name: str) -> Drive:
    sequence = BagSequence(bag.reader(), topic)
    times = [(scan.arrived_ns, scan.stamp_ns) for scan in sequence]
    scans = [DriveScan(f'{name}/{index:06d}', 'bag', SgorConfig().label_convention,
                       partial(bag.read, topic, *both)) for index, both in enumerate(times)]
    stamps = np.array([stamp_ns for _, stamp_ns in times], np.int64)
    return Drive(name, scans, _true_poses(bag.reader(), stamps.tolist()),
                 stamps_ns=stamps if (np.diff(stamps) > 0).all() else None,
                 warnings=sequence.warnings)


def _true_poses(bag: BagReader, stamps_ns: list[int]) -> NDArray[np.float64] | None:
    truth = dict(bag.poses(TRUTH_TOPIC))
    poses = [truth[stamp_ns] for stamp_ns in stamps_ns if stamp_ns in truth]
    return np.array(poses) if 0 < len(poses) == len(stamps_ns) else None


def _scan_of(cloud: RecordedCloud, label_field: str, time_field: str) -> StampedScan:
    """Return the scan of a cloud; of a broken one, when it was recorded, and why it is broken."""
    try:
        message = cloud.read()[2]
    except InputError as error:
        return StampedScan(cloud.bag_time_ns, '', partial(_refuse, str(error)),
                           cloud.bag_time_ns)
    return scan_of_cloud(message, label_field, cloud.bag_time_ns, time_field)


def _refuse(reason: str) -> SemanticScan:
    raise InputError(reason)
