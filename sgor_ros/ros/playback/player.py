"""Plays clouds to a running `sgor_node` over DDS and collects what it publishes."""
from collections.abc import Callable
from collections.abc import Iterable
import time
from types import TracebackType
from typing import Any
from typing import Self

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from ...io.header_stamp import stamp_ns_of
from .domain import Domain

# a fresh machine compiles at the first start, a slow one for minutes
START_TIMEOUT_S = 600.0
POLL_S = 0.02
# discovery is told to both sides, but not at the same moment
SETTLING_S = 0.5
DEPTH = 50


class Player:
    """Publishes on `points` and keeps what comes back; use it in a ``with``.

    No threads: everything arrives inside `spin_until`.

    Parameters
    ----------
    domain : Domain
    namespace : str
        Of the node, with a slash at both ends.
    reliability : ReliabilityPolicy
        Of the clouds.

    Attributes
    ----------
    odometry : list of nav_msgs/msg/Odometry
    loops : list of nav_msgs/msg/Odometry
    diagnostics : list of diagnostic_msgs/msg/DiagnosticArray
    sent_s, heard_s : dict of int to float
        Stamp of the scan to the moment its cloud was sent and its odometry heard, monotonic.
    """

    def __init__(self, domain: Domain, namespace: str = '/',
                 reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain.id)
        self.node = rclpy.create_node(
            'player' + namespace.rstrip('/').replace('/', '_'), context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._odometry_topic = namespace + 'odometry'
        self._points = self.node.create_publisher(
            PointCloud2, namespace + 'points', QoSProfile(depth=DEPTH, reliability=reliability))
        self.odometry: list[Odometry] = []
        self.loops: list[Odometry] = []
        self.diagnostics: list[DiagnosticArray] = []
        self.sent_s: dict[int, float] = {}
        self.heard_s: dict[int, float] = {}
        self.node.create_subscription(Odometry, self._odometry_topic, self._on_odometry, 100)
        self.node.create_subscription(Odometry, namespace + 'loop_closure', self.loops.append,
                                      100)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self.diagnostics.append,
                                      100)

    def __enter__(self) -> Self:
        """Do nothing: it is connected already."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Leave the domain."""
        self.close()

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def spin_until(self, done: Callable[[], bool], timeout_s: float = 20.0,
                   what: str = 'the node') -> None:
        """Receive until `done()`.

        Raises
        ------
        TimeoutError
            It was not done after a while; the message names `what`.
        """
        deadline = time.monotonic() + timeout_s
        while not done():
            if time.monotonic() > deadline:
                raise TimeoutError(f'{what}: nothing within {timeout_s:g} s')
            self._executor.spin_once(timeout_sec=POLL_S)

    def spin_for(self, seconds: float) -> None:
        """Receive for some time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=min(left, POLL_S))

    def wait_for_node(self, alive: Callable[[], bool] = lambda: True,
                      timeout_s: float = START_TIMEOUT_S) -> None:
        """Return once the node has compiled and listens, or is not alive any more."""
        self.spin_until(lambda: not alive() or (
            self._points.get_subscription_count() > 0
            and self.node.count_publishers(self._odometry_topic) > 0),
            timeout_s, 'start of the node')
        self.spin_for(SETTLING_S)

    def play(self, clouds: Iterable[tuple[int, PointCloud2 | bytes]], period_s: float,
             alive: Callable[[], bool] = lambda: True) -> None:
        """Send clouds at a steady rate, and receive meanwhile.

        Parameters
        ----------
        clouds : iterable of (int, PointCloud2 or bytes)
            Stamp in nanoseconds and the cloud, as a message or serialised.
        period_s : float
        alive : function
            Playing ends where it returns False.
        """
        due = time.monotonic()
        for stamp_ns, cloud in clouds:
            self.spin_for(due - time.monotonic())
            if not alive():
                return
            self.send(stamp_ns, cloud)
            due += period_s

    def send(self, stamp_ns: int, cloud: PointCloud2 | bytes) -> None:
        """Publish a cloud, a message or serialised."""
        self.sent_s[stamp_ns] = time.monotonic()
        self._points.publish(cloud)

    def _on_odometry(self, message: Odometry) -> None:
        self.heard_s[stamp_ns_of(message.header)] = time.monotonic()
        self.odometry.append(message)


def values_of(diagnostics: DiagnosticArray) -> dict[str, Any]:
    """Return the keys and values that the node told of a scan."""
    return {pair.key: pair.value for status in diagnostics.status for pair in status.values}
