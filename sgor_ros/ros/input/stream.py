"""The clouds of a topic as they come, for the thread that works."""
from collections.abc import Iterator
import time

from sensor_msgs.msg import PointCloud2

from ...io.sequence import scan_of_cloud
from ...io.sequence import StampedScan
from .latest_value_slot import LatestValueSlot


class CloudStream:
    """A `ScanSequence` without an end: whoever is slow gets the latest cloud.

    Parameters
    ----------
    topic : str
    label_field : str
        As `label_field_of` takes it.
    time_field : str
        As `time_field_of` takes it.

    Attributes
    ----------
    name : str
        The topic.
    """

    expected = None
    label_convention = None
    T_world_sensor = None
    warnings = ()

    def __init__(self, topic: str, label_field: str, time_field: str) -> None:
        self.name = topic
        self._label_field = label_field
        self._time_field = time_field
        self._slot: LatestValueSlot[tuple[PointCloud2, int]] = LatestValueSlot()

    @property
    def received(self) -> int:
        """How many clouds came."""
        return self._slot.received

    @property
    def replaced(self) -> int:
        """How many of them gave way to a newer one."""
        return self._slot.replaced

    def put(self, cloud: PointCloud2) -> None:
        """Take a cloud that has just arrived."""
        self._slot.put((cloud, time.monotonic_ns()))

    def close(self) -> None:
        """End the iteration."""
        self._slot.close()

    def __iter__(self) -> Iterator[StampedScan]:
        """Wait for one cloud after the other until the stream is closed."""
        for cloud, arrived_ns in self._slot:
            yield scan_of_cloud(cloud, self._label_field, arrived_ns, self._time_field)
