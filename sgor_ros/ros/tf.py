"""The transform of the odometry on /tf, for those who want it."""
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from ..core.common.settings import InputError
from ..io import messages
from ..tracker import TrackedScan
from .types import ros_type


class TransformPublisher:
    """What tf2's broadcaster is: a publisher of tf2_msgs/msg/TFMessage, with its QoS."""

    def __init__(self, node: Node) -> None:
        try:
            message = ros_type('tf2_msgs/msg/TFMessage')
        except ModuleNotFoundError as error:
            raise InputError('publish_tf = True: the package tf2_msgs is not installed; '
                             'apt install ros-jazzy-tf2-msgs') from error
        self._publisher: Publisher = node.create_publisher(message, '/tf', QoSProfile(depth=100))

    def publish(self, tracked: TrackedScan, odom_frame: str, sensor_frame: str) -> None:
        """Send the pose of a scan as the transform from `odom_frame` to `sensor_frame`."""
        assert tracked.T_odom_sensor is not None
        pose = messages.pose(ros_type, tracked.T_odom_sensor)
        at = pose.position
        transform = ros_type('geometry_msgs/msg/Transform')(
            translation=ros_type('geometry_msgs/msg/Vector3')(x=at.x, y=at.y, z=at.z),
            rotation=pose.orientation)
        stamped = ros_type('geometry_msgs/msg/TransformStamped')(
            header=messages.header(ros_type, tracked.stamp_ns, odom_frame),
            child_frame_id=sensor_frame, transform=transform)
        self._publisher.publish(ros_type('tf2_msgs/msg/TFMessage')(transforms=[stamped]))
