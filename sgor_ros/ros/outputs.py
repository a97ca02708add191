"""What the node publishes of a scan: poses in the frames that were asked for, edges, markers."""
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from ..io import messages
from ..io.frames import OdomFrame
from ..io.frames import parse_transform
from ..tracker import TrackedScan
from . import base
from .parameters import NodeConfig
from .publishers import publisher
from .tf import TransformPublisher
from .types import ros_type

# a pose graph wants every edge
RELATIVE_DEPTH = 100
REMEMBERED = 1000


class Outputs:
    """The publishers of results; all but the constructor runs on the worker's thread."""

    def __init__(self, node: Node, config: NodeConfig) -> None:
        self._odom = config.odom_frame
        self._base = config.base_frame
        self._pose = publisher(node, PoseStamped, 'pose', 10)
        self._odometry = publisher(node, Odometry, 'odometry', 10)
        self._relative = publisher(node, Odometry, 'relative_pose', RELATIVE_DEPTH)
        self._markers = publisher(node, MarkerArray, 'correspondences', 1)
        self._tf = TransformPublisher(node, config.invert_tf) if config.publish_tf else None
        self._extrinsic: base.Extrinsic | None = None
        if config.T_base_sensor:
            self._extrinsic = base.fixed(parse_transform(config.T_base_sensor, 'T_base_sensor'))
        elif config.base_frame:
            self._extrinsic = base.by_tf2(node, config.base_frame)
        self.odom_frame = OdomFrame()
        self._frames: dict[int, str] = {}    # of the scans that others may be registered to

    def publish(self, tracked: TrackedScan, sensor_frame: str) -> str:
        """Send what there is of a scan; return why it has no pose although it was registered."""
        trouble = ''
        if tracked.success:
            if tracked.T_reference_sensor is not None:
                self._relative.publish(messages.relative_pose(
                    ros_type, tracked, sensor_frame,
                    self._frames.get(tracked.reference_stamp_ns or 0, sensor_frame)))
            if tracked.keyframe:
                # more than the tracker can keep
                self._frames = dict(list(self._frames.items())[-REMEMBERED:])
                self._frames[tracked.stamp_ns] = sensor_frame
            trouble = self._publish_pose(tracked, sensor_frame)
        if not trouble and self._markers.get_subscription_count():
            self._markers.publish(messages.correspondence_markers(
                ros_type, self.odom_frame.of_sensor(tracked), self._odom))
        return trouble

    def _publish_pose(self, tracked: TrackedScan, sensor_frame: str) -> str:
        """Send pose, odometry and transform of the sensor, or of the base."""
        T_base_sensor = self._extrinsic and self._extrinsic(tracked.stamp_ns, sensor_frame)
        if isinstance(T_base_sensor, str):
            return T_base_sensor
        placed = self.odom_frame.place(tracked, T_base_sensor)
        frame = self._base or sensor_frame
        self._odometry.publish(messages.odometry(ros_type, placed, self._odom, frame))
        self._pose.publish(messages.pose_stamped(ros_type, placed, self._odom))
        if self._tf:
            self._tf.publish(placed, self._odom, frame)
        return ''
