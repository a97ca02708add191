"""A partner for the node over real DDS: publishes clouds, collects what the node publishes.

No threads: everything happens inside `Partner.spin_until`.
"""
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from sgor_ros.io.messages import point_cloud2
from sgor_ros.io.messages import stamp_ns_of
from sgor_ros.ros.types import ros_type

ROOT = Path(__file__).resolve().parents[1]
SETTLING_S = 0.5    # discovery is told to both sides, but not at the same moment


class Domain:
    """A ROS domain that no other test on this machine uses; the bound port is the claim."""

    def __init__(self):
        self._claim = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for self.id in range(1, 100):
            try:
                self._claim.bind(('127.0.0.1', 32100 + self.id))
                return
            except OSError:
                continue
        raise RuntimeError('all ROS domains are taken')

    def environment(self):
        """Return the environment of a process in this domain."""
        return {**os.environ, 'ROS_DOMAIN_ID': str(self.id),
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'PYTHONUNBUFFERED': '1',
                'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])}

    def close(self):
        self._claim.close()


class NodeProcess:
    """`sgor_node` as a process of its own, its output in a file."""

    def __init__(self, domain, log_path, *ros_arguments):
        self._log_path = Path(log_path)
        arguments = ['--ros-args', *ros_arguments] if ros_arguments else []
        with open(log_path, 'w') as log:
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'sgor_ros.ros.node', *arguments], stdout=log,
                stderr=subprocess.STDOUT, env=domain.environment(), cwd=ROOT)

    def log(self):
        """Return everything that the node has printed."""
        return self._log_path.read_text()

    def alive(self):
        return self.process.poll() is None

    def stop(self, how=signal.SIGINT, times=1, timeout_s=30.0):
        """Send a signal, once or more, and return the exit code."""
        for _ in range(times):
            if self.alive():
                self.process.send_signal(how)
                time.sleep(0.02)
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise


class Partner:
    """Publishes clouds on `points` and keeps what comes back, in the order of arrival.

    Attributes
    ----------
    odometry, poses, diagnostics : list of messages
    """

    def __init__(self, domain, prefix='/', reliability=ReliabilityPolicy.RELIABLE):
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        self._prefix = prefix
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain.id)
        self.node = rclpy.create_node(
            'partner' + prefix.rstrip('/').replace('/', '_'), context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._points = self.node.create_publisher(
            PointCloud2, prefix + 'points', QoSProfile(depth=50, reliability=reliability))
        self.odometry, self.poses, self.diagnostics = [], [], []
        for message, topic, store in ((Odometry, prefix + 'odometry', self.odometry),
                                      (PoseStamped, prefix + 'pose', self.poses),
                                      (DiagnosticArray, '/diagnostics', self.diagnostics)):
            self.node.create_subscription(message, topic, store.append, 100)

    def spin_until(self, done, timeout_s=20.0, what='the node'):
        """Receive until `done()`; raise TimeoutError after a while."""
        deadline = time.monotonic() + timeout_s
        while not done():
            if time.monotonic() > deadline:
                raise TimeoutError(f'{what}: nothing within {timeout_s} s')
            self._executor.spin_once(timeout_sec=0.02)

    def spin_for(self, seconds):
        """Receive for some time."""
        deadline = time.monotonic() + seconds
        self.spin_until(lambda: time.monotonic() >= deadline, seconds + 60.0)

    def wait_for_node(self, timeout_s=90.0):
        """Return once the node has compiled and listens."""
        self.spin_until(lambda: self._points.get_subscription_count() > 0
                        and self.node.count_publishers(self._prefix + 'odometry') > 0,
                        timeout_s, 'start of the node')
        self.spin_for(SETTLING_S)

    def send(self, cloud):
        """Publish a cloud, and return its stamp in nanoseconds."""
        self._points.publish(cloud)
        return stamp_ns_of(cloud.header)

    def play(self, clouds, period_s):
        """Publish clouds at a rate and receive meanwhile."""
        begin = time.monotonic()
        for index, cloud in enumerate(clouds):
            self.spin_until(lambda at=begin + index * period_s: time.monotonic() >= at)
            self.send(cloud)

    def outcome(self, cloud, timeout_s=20.0):
        """Publish a cloud, wait for what the node says about it: (level, message, values)."""
        before = len(self.diagnostics)
        self.send(cloud)
        self.spin_until(lambda: len(self.diagnostics) > before, timeout_s, 'diagnostics')
        return status(self.diagnostics[before])

    def call(self, kind, name, request, timeout_s=20.0):
        """Call a service of the node."""
        client = self.node.create_client(kind, name)
        self.spin_until(client.service_is_ready, timeout_s, f'service {name}')
        answer = client.call_async(request)
        self.spin_until(answer.done, timeout_s, f'answer of {name}')
        self.node.destroy_client(client)
        return answer.result()

    def forget(self):
        """Drop what was collected so far."""
        for store in (self.odometry, self.poses, self.diagnostics):
            store.clear()

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


def status(diagnostics):
    """Return (level, message, values) of a DiagnosticArray of the node."""
    only, = diagnostics.status
    return only.level, only.message, {pair.key: pair.value for pair in only.values}


def cloud(points, labels, stamp_ns, frame_id='lidar'):
    """Return a PointCloud2 of rclpy."""
    return point_cloud2(ros_type, points, labels, stamp_ns, frame_id)


def matrix(pose):
    """Return the (4, 4) transformation of a geometry_msgs/msg/Pose."""
    p, q = pose.position, pose.orientation
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    T[:3, 3] = p.x, p.y, p.z
    return T


def difference(T, T_true):
    """Return translation (m) and rotation (rad) between two poses."""
    error = np.linalg.inv(T_true) @ T
    return (float(np.linalg.norm(error[:3, 3])),
            float(np.linalg.norm(Rotation.from_matrix(error[:3, :3]).as_rotvec())))
