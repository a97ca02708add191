"""Stands in for tf2_ros where ROS comes from wheels: one hop, the newest transform, real /tf.

Only what the node calls, with the names and arguments of tf2_ros. What it can't show (chains,
interpolation) was not run.
"""
import threading
import time

from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
from tf2_msgs.msg import TFMessage


class TransformException(Exception):
    pass


class Buffer:
    def __init__(self, node):
        self._changed = threading.Condition()
        self._found = {}

    def take(self, message):
        with self._changed:
            for item in message.transforms:
                self._found[item.header.frame_id, item.child_frame_id] = item
            self._changed.notify_all()

    def lookup_transform(self, target_frame, source_frame, stamp, timeout):
        key, end = (target_frame, source_frame), time.monotonic() + timeout.nanoseconds * 1e-9
        with self._changed:
            while key not in self._found:
                if not self._changed.wait(end - time.monotonic()):
                    raise TransformException(f'"{target_frame}" passed to lookupTransform '
                                             'argument target_frame does not exist')
            return self._found[key]


class TransformListener:
    def __init__(self, buffer, node):
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TFMessage, '/tf', buffer.take, 100)
        node.create_subscription(TFMessage, '/tf_static', buffer.take, latched)
