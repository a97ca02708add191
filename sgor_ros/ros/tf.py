"""The transform of the odometry on /tf, for those who want it."""
from rclpy.node import Node
from rclpy.publisher import Publisher

from ..core.common import se3
from ..core.common.settings import InputError
from ..io import messages
from ..tracker import TrackedScan
from .publishers import publisher
from .types import ros_type


class TransformPublisher:
    """What tf2's broadcaster is: a publisher of tf2_msgs/msg/TFMessage, with its QoS.

    Parameters
    ----------
    node : Node
    inverted : bool
        Whether the odom frame is the child: for a base that has a parent already.
    """

    def __init__(self, node: Node, inverted: bool) -> None:
        try:
            self._message = ros_type('tf2_msgs/msg/TFMessage')
        except ModuleNotFoundError as error:
            raise InputError('publish_tf = True: the package tf2_msgs is not installed; '
                             'apt install ros-jazzy-tf2-msgs') from error
        self._inverted = inverted
        self._publisher: Publisher = publisher(node, self._message, '/tf', 100)

    def publish(self, tracked: TrackedScan, odom_frame: str, frame: str) -> None:
        """Send the pose of a scan as the transform between `odom_frame` and `frame`."""
        assert tracked.T_odom_sensor is not None
        T, parent, child = tracked.T_odom_sensor, odom_frame, frame
        if self._inverted:
            T, parent, child = se3.inverse(T), frame, odom_frame
        self._publisher.publish(self._message(transforms=[messages.transform_stamped(
            ros_type, T, tracked.stamp_ns, parent, child)]))
