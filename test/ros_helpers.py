"""A partner for the node over real DDS that waits for answers, and small conversions."""
from geometry_msgs.msg import PoseStamped
import numpy as np
from rclpy.qos import ReliabilityPolicy
from scipy.spatial.transform import Rotation

from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import point_cloud2
from sgor_ros.ros.playback.player import Player
from sgor_ros.ros.playback.player import SETTLING_S
from sgor_ros.ros.playback.player import values_of
from sgor_ros.ros.types import ros_type
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

START_NS = 100_000_000_000


class Partner(Player):
    """A player that keeps `pose` too, in `poses`, and asks the node questions."""

    def __init__(self, domain, namespace='/', reliability=ReliabilityPolicy.RELIABLE):
        super().__init__(domain, namespace, reliability)
        self.poses = []
        self.node.create_subscription(PoseStamped, namespace + 'pose', self.poses.append, 100)

    def outcome(self, cloud, timeout_s=20.0):
        """Publish a cloud, wait for what the node says about it: (level, message, values)."""
        return self.outcome_of(stamp_ns_of(cloud.header), cloud, timeout_s)

    def outcome_of(self, stamp_ns, cloud, timeout_s=20.0):
        """Do the same with a cloud that may be serialised."""
        before = len(self.diagnostics)

        def told():
            return [message for message in self.diagnostics[before:]
                    if stamp_ns_of(message.header) == stamp_ns]

        self.send(stamp_ns, cloud)
        self.spin_until(told, timeout_s, 'diagnostics')
        return status(told()[0])

    def hear(self, kind, topic):
        """Subscribe to a topic that the node has, and return the list that fills."""
        heard = []
        self.node.create_subscription(kind, topic, heard.append, 100)
        self.spin_until(lambda: self.node.count_publishers(topic), 240.0, topic)
        self.spin_for(SETTLING_S)
        return heard

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


def street(count, seed=0):
    """Return the first scans of a drive: [(stamp in ns, points, labels, true pose)]."""
    lidar = Lidar(beams=32, columns=600)
    return [(START_NS + round(stamp * 1e9), points, labels, pose)
            for stamp, points, labels, pose in simulate(count, seed=seed, lidar=lidar)]


def status(diagnostics):
    """Return (level, message, values) of a DiagnosticArray of the node."""
    only, = diagnostics.status
    return only.level, only.message, values_of(diagnostics)


def stamped(clouds):
    """Return (stamp in ns, cloud) of clouds, as `Player.play` takes them."""
    return [(stamp_ns_of(cloud.header), cloud) for cloud in clouds]


def cloud(points, labels, stamp_ns, frame_id='lidar'):
    """Return a PointCloud2 of rclpy."""
    return point_cloud2(ros_type, points, labels, stamp_ns, frame_id)


def difference(T, T_true):
    """Return translation (m) and rotation (rad) between two poses."""
    error = np.linalg.inv(T_true) @ T
    return (float(np.linalg.norm(error[:3, 3])),
            float(np.linalg.norm(Rotation.from_matrix(error[:3, :3]).as_rotvec())))
