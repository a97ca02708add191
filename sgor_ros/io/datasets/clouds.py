"""A drive as the clouds of a bag: what `sgor_replay` takes."""
from collections.abc import Iterator
from functools import partial
from types import TracebackType
from typing import Any
from typing import Self

from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from ..bags import RecordedCloud
from ..messages import point_cloud2
from .drive import Drive

PERIOD_NS = 100_000_000
"""Between scans whose times nobody knows: spinning LiDARs mostly turn at 10 Hz."""

FRAME_ID = 'lidar'


class DriveReader:
    """Reads a drive as `BagReader` reads the bag that would be made of it.

    Parameters
    ----------
    drive : Drive
        Its name is the one topic.
    """

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._types = get_typestore(Stores.ROS2_JAZZY).types.__getitem__

    def __enter__(self) -> Self:
        """Need nothing opened."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Leave nothing open."""

    def cloud_topics(self) -> dict[str, int]:
        """Return the name of the drive, and how many scans it has."""
        return {self._drive.name: len(self._drive)}

    def find_topic(self, label_field: str) -> str:
        """Return the name of the drive."""
        return self._drive.name

    def clouds(self, topic: str) -> Iterator[RecordedCloud]:
        """Iterate over the scans; those without stamps come at 10 Hz from 1 s on."""
        stamps = ([(i + 10) * PERIOD_NS for i in range(len(self._drive))]
                  if self._drive.stamps_ns is None else self._drive.stamps_ns.tolist())
        for index, stamp_ns in enumerate(stamps):
            yield RecordedCloud(stamp_ns, partial(self._read, index, stamp_ns))

    def _read(self, index: int, stamp_ns: int) -> tuple[int, str, Any]:
        scan = self._drive.read(index)
        return stamp_ns, FRAME_ID, point_cloud2(self._types, scan.points, scan.labels, stamp_ns,
                                                FRAME_ID)
