"""/diagnostics at a steady rate, scan or no scan, and the log of trouble."""
from collections.abc import Callable
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.node import Node

from ..output.publishers import publisher
from . import status
from .throttled_log import ThrottledLog

PERIOD_S = 1.0


class DiagnosticsPublisher:
    """Reports each scan, and what the node does when there has been none for a while.

    Parameters
    ----------
    node : Node
    log : ThrottledLog
    counts : function
        Returns the counts of scans so far.
    idle : function
        Returns level and words for what the node does when no scan comes.
    """

    def __init__(self, node: Node, log: ThrottledLog, counts: Callable[[], status.Counts],
                 idle: Callable[[], tuple[bytes, str]]) -> None:
        self._node = node
        self._log = log
        self._counts = counts
        self._idle = idle
        self._frame = ''
        self._told_at = time.monotonic()
        self._lock = threading.Lock()
        self._publisher = publisher(node, DiagnosticArray, '/diagnostics', 10)
        # the wall's time, not the bag's, which may stand still
        node.create_timer(PERIOD_S, self._beat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def report(self, stamp_ns: int, frame: str, level: bytes, message: str,
             values: dict[str, str]) -> None:
        """Publish what became of a scan, and log it where that is news."""
        self._log.warn_on_change('' if level == status.OK else message,
                          f'scan at {stamp_ns * 1e-9:.3f} s')
        self._frame = frame
        self._publish(stamp_ns, level, message, values)

    def _beat(self) -> None:
        if time.monotonic() - self._told_at >= PERIOD_S:
            level, message = self._idle()
            self._publish(self._node.get_clock().now().nanoseconds, level, message, {})

    def _publish(self, stamp_ns: int, level: bytes, message: str, values: dict[str, str]
                 ) -> None:
        with self._lock:
            self._told_at = time.monotonic()
            self._publisher.publish(status.diagnostics(
                self._node.get_fully_qualified_name(), self._frame, stamp_ns, level, message,
                self._counts(), values))
