"""Where the messages of the pipeline go: what it asks of a sink, and the sink into a bag."""
from collections.abc import Callable
from typing import Any
from typing import Protocol

from ..io.bags import BagWriter

ODOMETRY, POSE, RELATIVE_POSE, CORRESPONDENCES = (
    'odometry', 'pose', 'relative_pose', 'correspondences')
LOOP_CLOSURE, PATH, MAP_CLOUD, HYPOTHESES = 'loop_closure', 'path', 'map_cloud', 'hypotheses'
"""Of the mapper alone."""
TF = '/tf'


class MessageSink(Protocol):
    """Takes the messages of the pipeline."""

    def types(self, name: str) -> Any:
        """Return the message class of a name such as ``'nav_msgs/msg/Odometry'``."""

    def wants(self, topic: str) -> bool:
        """Whether the message of a topic is to be made for the next scan."""

    def write(self, topic: str, message: Any, arrived_ns: int) -> None:
        """Take a message; `arrived_ns` is that of its scan."""


class BagSink:
    """Writes what a node publishes into a bag, all but what can be had from it."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self.types: Callable[[str], Any] = writer.types

    def wants(self, topic: str) -> bool:
        """Whether it is one of the results that cannot be had from the others."""
        return topic not in (TF, PATH, MAP_CLOUD)

    def write(self, topic: str, message: Any, arrived_ns: int) -> None:
        """Write a message as recorded when its scan was."""
        self._writer.write(f'/{topic}', message, arrived_ns)
