"""Bags without ROS, by rosbags: ROS 1 .bag, ROS 2 sqlite3 and mcap."""
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import AbstractContextManager
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import sys
from types import TracebackType
from typing import Any
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from ..core.common.settings import InputError
from .bounded import BoundedPath
from .broken import readable
from .header_stamp import stamp_ns_of
from .label_field import field_names
from .label_field import label_field_of
from .messages import matrix_of
from .messages import matrix_of_transform
from .writing import new_folder
from .writing import refuse_existing

# as rosbags has it
if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MENDS = {'.mcap': 'mcap recover', '.bag': 'rosbag reindex', '.db3': 'ros2 bag reindex',
         '': 'ros2 bag reindex (or mcap recover, for its .mcap)'}
KNOWN = get_typestore(Stores.ROS2_JAZZY)
CLOUD_TYPE = 'sensor_msgs/msg/PointCloud2'
POSES: dict[str, Callable[[Any], NDArray[np.float64]]] = {
    'nav_msgs/msg/Odometry': lambda message: matrix_of(message.pose.pose),
    'geometry_msgs/msg/PoseStamped': lambda message: matrix_of(message.pose),
    'geometry_msgs/msg/PoseWithCovarianceStamped': lambda message: matrix_of(message.pose.pose),
    'geometry_msgs/msg/TransformStamped': lambda message: matrix_of_transform(message.transform)}
"""Types of messages with a stamp and a pose."""
BAG_FILES = ('.mcap', '.db3', '.bag')

ZSTD = b'\x28\xb5\x2f\xfd'
"""How compressed data begins; no message does."""
LARGEST_MESSAGE = 1 << 30
"""Bytes, of a compressed message: what claims to be more is cut off, and refused."""
INSTEAD = {
    'CustomMsg': 'Livox: start the driver with xfer_format 0, which publishes PointCloud2, or '
    'convert the bag',
    'VelodyneScan': 'packets of Velodyne: velodyne_pointcloud makes PointCloud2 of them',
    'PacketMsg': 'packets of Ouster: ouster_ros makes PointCloud2 of them',
    'LaserScan': 'of a planar LiDAR, which is too little'}
"""Types of LiDARs that are no PointCloud2, and what to do about them."""


def compressed_or_ros1(path: Path) -> str:
    """Return what to do about a path that is no bag itself but of bags; empty: nothing."""
    if path.is_file() and path.name.endswith('.zstd'):
        return 'a compressed file of a bag: give the folder with its metadata.yaml, or zstd -d it'
    bags = sorted(file.name for file in path.glob('*.bag')) if path.is_dir() else []
    return (f'a folder of ROS 1 bags, give one of them: {", ".join(bags[:10])}'
            + (', ...' if len(bags) > 10 else '')) if bags else ''


def is_bag(path: str | Path) -> bool:
    """Whether a path looks like a bag: a file of that name, or a folder with one."""
    path = Path(path)
    if not path.is_dir():
        return path.suffix in BAG_FILES
    return (path / 'metadata.yaml').is_file() or any(
        file.suffix in BAG_FILES[:2] for file in path.iterdir())


@dataclass(frozen=True, eq=False)
class RecordedCloud:
    """One cloud as it lies in the bag; `read` may find it broken when the next one is not.

    Attributes
    ----------
    bag_time_ns : int
        When it was recorded.
    read : function
        Returns stamp in nanoseconds, frame id and the sensor_msgs/msg/PointCloud2. Raises
        InputError where the bytes are no such message.
    """

    bag_time_ns: int
    read: Callable[[], tuple[int, str, Any]]


class BagReader:
    """The clouds of a bag; use it in a ``with``.

    Parameters
    ----------
    path : str or Path
        Folder of a ROS 2 bag, or one file: .mcap, .db3 or .bag.

    Raises
    ------
    InputError
        No such bag, or one that cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = BoundedPath(path)
        if not self.path.exists():
            raise InputError(f'{path}: no such bag')
        with self._readable():
            self._reader = AnyReader(
                [self.path], default_typestore=KNOWN)

    def __enter__(self) -> Self:
        """Open the bag."""
        with self._readable():
            self._reader.open()
            self._topics = self._count_clouds()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Close the bag."""
        self._reader.close()

    def cloud_topics(self) -> dict[str, int]:
        """Return the PointCloud2 topics that have messages, and how many."""
        return dict(self._topics)

    def count(self, topic: str) -> int:
        """Return how many clouds a topic has.

        Raises
        ------
        InputError
            No such topic of clouds.
        """
        if topic not in self._topics:
            raise InputError(f'topic {topic}: no clouds in {self.path}; there are '
                             f'{", ".join(self._topics) or "none"}')
        return self._topics[topic]

    def find_topic(self, label_field: str) -> str:
        """Return the one topic of labelled clouds, or the one topic of clouds.

        Parameters
        ----------
        label_field : str
            As `label_field_of` takes it.

        Raises
        ------
        InputError
            There is none, or more than one.
        """
        topics = list(self.cloud_topics())
        if len(topics) > 1:
            topics = [t for t in topics if self._is_labelled(t, label_field)] or topics
        if not topics:
            types = {c.topic: c.msgtype.rpartition('/')[2] for c in self._reader.connections}
            told = [f'; {topic} has {kind} ({INSTEAD[kind]})'
                    for topic, kind in sorted(types.items()) if kind in INSTEAD]
            raise InputError(f'{self.path}: no PointCloud2 in this bag; its topics are '
                             f'{", ".join(sorted(types)) or "none at all"}{"".join(told)}')
        if len(topics) > 1:
            raise InputError(f'{self.path}: several topics of clouds, choose one by --topic: '
                             f'{", ".join(topics)}')
        return topics[0]

    def clouds(self, topic: str, at_ns: int | None = None) -> Iterator[RecordedCloud]:
        """Iterate over the clouds of a topic in the order of their recording.

        Parameters
        ----------
        topic : str
        at_ns : int, optional
            Only those that were recorded at this time, nanoseconds.

        Raises
        ------
        InputError
            No such topic of clouds, or a bag that breaks off.
        """
        self.count(topic)
        return self._iterate([c for c in self._reader.connections
                              if c.topic == topic and c.msgtype == CLOUD_TYPE], at_ns)

    def poses(self, topic: str) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Iterate over the poses of a topic, if there are any: stamp, (4, 4) pose."""
        connections = [c for c in self._reader.connections
                       if c.topic == topic and c.msgtype in POSES]
        with self._readable():
            for connection, _, raw in self._reader.messages(connections) if connections else ():
                message: Any = self._reader.deserialize(raw, connection.msgtype)
                yield stamp_ns_of(message.header), POSES[connection.msgtype](message)

    def timed_poses(self, topic: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the poses of a topic in the order of their stamps, one for each stamp.

        Parameters
        ----------
        topic : str
            Of odometry, or of stamped poses or transforms.

        Returns
        -------
        stamps_ns : (N,) int64
            Nanoseconds, increasing.
        poses : (N, 4, 4) float64

        Raises
        ------
        InputError
            No such topic of poses, none on it, or one that is not finite.
        """
        known = sorted({c.topic for c in self._reader.connections if c.msgtype in POSES})
        if topic not in known:
            raise InputError(f'topic {topic}: no poses in {self.path}; there are '
                             f'{", ".join(known) or "none"}')
        found = dict(self.poses(topic))
        if not found:
            raise InputError(f'topic {topic}: no message on it in {self.path}')
        for stamp_ns, T in found.items():
            if not np.isfinite(T).all():
                raise InputError(f'topic {topic}: the pose at {stamp_ns * 1e-9:.3f} s is not '
                                 'finite')
        stamps_ns = sorted(found)
        return np.array(stamps_ns, np.int64), np.array([found[stamp] for stamp in stamps_ns])

    def _iterate(self, connections: list[Connection], at_ns: int | None
                 ) -> Iterator[RecordedCloud]:
        stop = None if at_ns is None else at_ns + 1
        with self._readable():
            for _, time_ns, raw in self._reader.messages(connections, at_ns, stop):
                yield RecordedCloud(time_ns, partial(self._read, raw))

    def _count_clouds(self) -> dict[str, int]:
        topics: dict[str, int] = {}
        for kind in (CLOUD_TYPE, 'sensor_msgs/msg/PointField'):
            # a bag brings its own definitions along
            told = self._reader.typestore.fielddefs.get(kind, KNOWN.fielddefs[kind])[1]
            if told != KNOWN.fielddefs[kind][1]:
                raise InputError(f'{self.path}: its {kind} has other fields than that of ROS')
        for connection in self._reader.connections:
            # sqlite3 keeps anything in any column, YAML in any place
            if not isinstance(connection.topic, str):
                raise InputError(f'{self.path}: {connection.topic!r} is no name of a topic')
            if not isinstance(connection.msgtype, str):
                raise InputError(f'{self.path}: {connection.topic} is of type '
                                 f'{connection.msgtype!r}, which is no name of a type')
            if connection.msgtype == CLOUD_TYPE and connection.msgcount:
                topics[connection.topic] = topics.get(connection.topic, 0) + connection.msgcount
        return topics

    def _readable(self) -> AbstractContextManager[None]:
        return readable(self.path, 'if it broke off while it was recorded, '
                        f'{MENDS.get(self.path.suffix, MENDS[""])} mends it')

    def _is_labelled(self, topic: str, label_field: str) -> bool:
        try:
            first = next(self.clouds(topic)).read()[2]
        except (InputError, StopIteration):
            return False
        return label_field_of(first, label_field) in field_names(first)

    def _read(self, raw: bytes) -> tuple[int, str, Any]:
        with readable('a message of the bag'):
            if raw[:4] == ZSTD:    # as the metadata.yaml says, which may not be there
                raw = zstd.ZstdDecompressor().decompress(raw, LARGEST_MESSAGE)
            message: Any = self._reader.deserialize(raw, CLOUD_TYPE)
            return stamp_ns_of(message.header), message.header.frame_id, message


class BagWriter:
    """Writes an mcap bag that Jazzy plays; use it in a ``with``.

    The bag is there once it is complete, at the end of the ``with``; after an error there is none.

    Parameters
    ----------
    path : str or Path
        Folder to create; it must not exist.

    Raises
    ------
    InputError
        The folder is there, or cannot be made.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self._store = KNOWN
        self._connections: dict[str, Connection] = {}
        refuse_existing(self._path)

    def __enter__(self) -> Self:
        """Create the bag beside its place."""
        with ExitStack() as stack:
            place = stack.enter_context(new_folder(self._path))
            self._writer = stack.enter_context(Writer(
                place, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP))
            self._open = stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Finish the bag and move it to its place, or clear it away."""
        self._open.__exit__(kind, error, trace)

    def types(self, name: str) -> Any:
        """Return the message class of a name such as ``'nav_msgs/msg/Odometry'``."""
        return self._store.types[name]

    def write(self, topic: str, message: Any, time_ns: int) -> None:
        """Add a message, built of `types`, as recorded at `time_ns`."""
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store)
        self._writer.write(self._connections[topic], time_ns,
                           self._store.serialize_cdr(message, kind))
