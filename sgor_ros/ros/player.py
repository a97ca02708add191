"""Plays clouds to a running `sgor_node` over DDS and collects what it publishes."""
from collections.abc import Callable
from collections.abc import Iterable
from dataclasses import dataclass
from dataclasses import field
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time
from types import TracebackType
from typing import Any
from typing import Self

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
import numpy as np
from numpy.typing import NDArray
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from ..core import se3
from ..core.settings import InputError
from ..io.bags import CLOUD_TYPE
from ..io.messages import stamp_ns_of

# a fresh machine compiles at the first start
START_TIMEOUT_S = 240.0
# after the last cloud, for its answer
LAST_ANSWER_S = 15.0
STOP_TIMEOUT_S = 20.0
POLL_S = 0.05
# discovery is told to both sides, but not at the same moment
SETTLING_S = 0.5


def isolate() -> None:
    """Keep what follows, in this process and its children, off the user's own ROS graph."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    # 215 to 232 are free of Linux's ephemeral ports and hardly ever chosen by hand
    os.environ['ROS_DOMAIN_ID'] = str(215 + os.getpid() % 18)


class NodeProcess:
    """`sgor_node` as a process of its own; use it in a ``with``.

    Parameters
    ----------
    log : Path
        File for what it prints.
    arguments : sequence of str
        ROS arguments, such as ``-p mode:=keyframe``.
    """

    def __init__(self, log: Path, *arguments: str) -> None:
        self.log = log
        with log.open('w') as file:
            self._process = subprocess.Popen(
                [sys.executable, '-m', 'sgor_ros.ros.node', '--ros-args', *arguments],
                stdout=file, stderr=subprocess.STDOUT)

    def __enter__(self) -> Self:
        """Do nothing: it runs already."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """End it whatever happened."""
        if self.alive():
            self._process.kill()
        self._process.wait()

    def alive(self) -> bool:
        """Return whether it still runs."""
        return self._process.poll() is None

    def stop(self) -> int:
        """Interrupt it as Ctrl-C does and return its exit code."""
        self._process.send_signal(signal.SIGINT)
        try:
            return self._process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def memory_mb(self) -> float:
        """Return the memory that it holds now; NaN where the system does not tell."""
        try:
            pages = int(Path(f'/proc/{self._process.pid}/statm').read_text().split()[1])
        except (OSError, ValueError, IndexError):
            return float('nan')
        return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


@dataclass
class Heard:
    """What came back.

    Attributes
    ----------
    sent : list of int
        Stamps of the clouds that were sent, nanoseconds.
    poses : dict of int to (4, 4) float64
        Stamp to T_odom_sensor, from `odometry`.
    seconds : dict of int to float
        Stamp to the time that the node spent on the scan, from `/diagnostics`.
    latency_s : dict of int to float
        Stamp to the time from sending the cloud to hearing the odometry.
    counts : dict of str to int
        received, processed, replaced and failed, as the node counted them last.
    """

    sent: list[int] = field(default_factory=list)
    poses: dict[int, NDArray[np.float64]] = field(default_factory=dict)
    seconds: dict[int, float] = field(default_factory=dict)
    latency_s: dict[int, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)


class Player:
    """Publishes on `points`, hears `odometry` and `/diagnostics`; use it in a ``with``."""

    def __init__(self) -> None:
        rclpy.init()
        self._node = node = Node('sgor_player')
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._points = node.create_publisher(
            PointCloud2, 'points', QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE))
        node.create_subscription(Odometry, 'odometry', self._on_odometry, 100)
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        self._sent_at: dict[int, float] = {}
        self.heard = Heard()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def __enter__(self) -> Self:
        """Do nothing: it listens already."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Stop listening."""
        self._executor.shutdown()
        self._thread.join()
        rclpy.try_shutdown()

    def wait_for_node(self, alive: Callable[[], bool]) -> bool:
        """Return True once the node listens to the clouds, False when that will not be."""
        ready = _wait(lambda: self._points.get_subscription_count() > 0
                      and self._node.count_publishers('odometry') > 0, START_TIMEOUT_S, alive)
        time.sleep(SETTLING_S)
        return ready

    def play(self, clouds: Iterable[tuple[int, Any]], period_s: float,
             alive: Callable[[], bool]) -> Heard:
        """Send clouds at a steady rate and wait for the answer to the last one.

        Parameters
        ----------
        clouds : iterable of (int, message)
            Stamp in nanoseconds and the PointCloud2 of rosbags, as a bag has it.
        period_s : float
        alive : function
            Playing ends where it returns False.
        """
        due = time.monotonic()
        for stamp_ns, message in clouds:
            raw = bytes(self._store.serialize_cdr(message, CLOUD_TYPE))
            time.sleep(max(0.0, due - time.monotonic()))
            if not alive():
                break
            self._sent_at[stamp_ns] = time.monotonic()
            self._points.publish(raw)
            self.heard.sent.append(stamp_ns)
            due += period_s
        if not self.heard.sent:
            raise InputError('clouds: there is none to play')
        last = self.heard.sent[-1]
        _wait(lambda: last in self.heard.seconds, LAST_ANSWER_S, alive)
        return self.heard

    def _on_odometry(self, message: Odometry) -> None:
        now, stamp_ns = time.monotonic(), stamp_ns_of(message.header)
        pose = message.pose.pose
        x, q = pose.position, pose.orientation
        self.heard.poses[stamp_ns] = se3.compose(
            Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), np.array([x.x, x.y, x.z]))
        self.heard.latency_s[stamp_ns] = now - self._sent_at.get(stamp_ns, float('nan'))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if 'seconds' in values:
                self.heard.seconds[stamp_ns_of(message.header)] = float(values['seconds'])
                self.heard.counts = {name: int(values[name]) for name in
                                     ('received', 'processed', 'replaced', 'failed')}


def _wait(ready: Callable[[], bool], timeout_s: float, alive: Callable[[], bool]) -> bool:
    end = time.monotonic() + timeout_s
    while time.monotonic() < end and alive():
        if ready():
            return True
        time.sleep(POLL_S)
    return ready()
