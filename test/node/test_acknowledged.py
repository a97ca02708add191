"""Edges that a subscriber may miss are counted, over real DDS: it stands still meanwhile."""
import signal
import subprocess
import sys
import time

import rclpy
from rclpy.context import Context
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import String

from sgor_ros.ros.output.acknowledged import Acknowledged

DEPTH = 20
SUBSCRIBER = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('slow')
heard = []
node.create_subscription(String, '/edges', lambda message: print(message.data, flush=True), 100)
rclpy.spin(node)
"""


def test_messages_that_leave_the_queue_unacknowledged_are_counted(domain):
    context = Context()
    rclpy.init(context=context, domain_id=domain.id)
    slow = subprocess.Popen([sys.executable, '-c', SUBSCRIBER], env=domain.environment(),
                            stdout=subprocess.PIPE, text=True)
    try:
        node = rclpy.create_node('publisher', context=context)
        publisher = node.create_publisher(String, '/edges', DEPTH)
        assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        edges = Acknowledged(publisher)
        until(lambda: publisher.get_subscription_count() == 1)
        numbers = iter(range(1000))

        def publish(count, pause_s):
            for number, _ in zip(numbers, range(count), strict=False):
                edges.expect_one()
                publisher.publish(String(data=str(number)))
                time.sleep(pause_s)

        for _ in range(6):    # fewer at once than the queue holds
            publish(DEPTH // 2, 0.0)
            until_acknowledged(publisher)
        assert edges.overdue == 0
        slow.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        publish(3 * DEPTH, 0.001)
        told = edges.overdue
        slow.send_signal(signal.SIGCONT)
        until_acknowledged(publisher)
        publish(DEPTH, 0.02)
        assert edges.overdue == told, 'it keeps up again'
        time.sleep(1.0)
        slow.send_signal(signal.SIGKILL)
        heard = slow.communicate()[0].split()
        missed = 7 * DEPTH - len(heard)
        assert told == 2 * DEPTH
        assert 0 <= missed <= told, 'buffers of the system may hold what the queue does not'
    finally:
        slow.kill()
        rclpy.shutdown(context=context)


def until_acknowledged(publisher):
    until(lambda: publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=0.1)))


def until(done):
    deadline = time.monotonic() + 30
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.05)
