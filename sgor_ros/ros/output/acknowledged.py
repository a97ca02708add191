"""Counts messages that a slow subscriber may never get: more than that no publisher knows."""
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy
from rclpy.qos import ReliabilityPolicy


class Acknowledged:
    """Follows whether all reliable subscribers keep up with a publisher.

    No event of ROS tells a publisher that its queue overflowed, or what lies in the buffers of a
    subscriber. What it can ask is whether all messages so far are acknowledged. More without that
    than the queue holds: the oldest cannot be sent again.

    Parameters
    ----------
    publisher : Publisher

    Attributes
    ----------
    overdue : int
        Messages that left the queue unacknowledged: no more than these are lost on the way.
    """

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        qos = publisher.qos_profile
        # the others keep all, or promise nothing
        self._counts = (qos.history == HistoryPolicy.KEEP_LAST
                        and qos.reliability == ReliabilityPolicy.RELIABLE)
        self._depth = qos.depth
        self._waiting = 0
        self.overdue = 0

    def expect_one(self) -> None:
        """Note that one more message is about to be published."""
        if not self._counts:
            return
        if self._publisher.wait_for_all_acked(Duration(nanoseconds=1)):
            self._waiting = 0
        self._waiting += 1
        self.overdue += self._waiting > self._depth
