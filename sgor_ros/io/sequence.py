"""Scans in the order of recording, wherever they come from: a folder, a bag, a live topic."""
from collections.abc import Callable
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..core.scan.scan import SemanticScan
from .header_stamp import stamp_ns_of
from .label_field import AUTO
from .label_field import choice_in_words
from .label_field import label_field_of
from .pointcloud2 import decode
from .time_field import time_field_of


@dataclass(frozen=True, eq=False)
class StampedScan:
    """One scan of a sequence, read when it is asked for.

    Attributes
    ----------
    stamp_ns : int
        When it was taken, nanoseconds.
    frame_id : str
        Frame of the sensor, as the message has it.
    read : callable
        Returns the `SemanticScan`. Raises InputError where the bytes are no scan.
    arrived_ns : int
        When it was recorded (a bag) or received (a live topic, by a monotonic clock), nanoseconds.
    note : str
        Which field its class ids come from, in words; empty where there was no choice.
    """

    stamp_ns: int
    frame_id: str
    read: Callable[[], SemanticScan]
    arrived_ns: int
    note: str = ''


class ScanSequence(Protocol):
    """Scans of one drive in the order of recording."""

    @property
    def name(self) -> str:
        """That of the drive, or of the topic."""

    @property
    def expected(self) -> int | None:
        """How many scans there are; a damaged bag has fewer, and of a live topic nobody knows."""

    @property
    def label_convention(self) -> str | None:
        """What the class ids mean; None where the data does not tell, as in messages."""

    @property
    def T_world_sensor(self) -> NDArray[np.float64] | None:
        """True pose of each scan, (N, 4, 4), where they are known."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may be wrong with the sequence as a whole, in words."""

    def __iter__(self) -> Iterator[StampedScan]: ...


def scan_of_cloud(message: Any, label_field: str, arrived_ns: int,
                  time_field: str = AUTO) -> StampedScan:
    """Return the scan of a sensor_msgs/msg/PointCloud2, of rclpy or of rosbags.

    Parameters
    ----------
    message : sensor_msgs/msg/PointCloud2
        Decoded when the scan is read.
    label_field : str
        As `label_field_of` takes it.
    arrived_ns : int
        As `StampedScan` has it.
    time_field : str
        As `time_field_of` takes it.
    """
    return StampedScan(
        stamp_ns_of(message.header), message.header.frame_id,
        partial(_decoded, message, label_field, time_field), arrived_ns,
        choice_in_words(message, label_field))


def _decoded(message: Any, label_field: str, time_field: str) -> SemanticScan:
    return decode(message, label_field_of(message, label_field),
                  time_field_of(message, time_field), guessed=time_field == AUTO)
