"""The messages of the pipeline to the node's topics."""
from typing import Any

from rclpy.node import Node

from ...core.common.settings import InputError
from ...pipeline.sinks import CORRESPONDENCES
from ...pipeline.sinks import HYPOTHESES
from ...pipeline.sinks import LOOP_CLOSURE
from ...pipeline.sinks import MAP_CLOUD
from ...pipeline.sinks import ODOMETRY
from ...pipeline.sinks import PATH
from ...pipeline.sinks import POSE
from ...pipeline.sinks import RELATIVE_POSE
from ...pipeline.sinks import TF
from ..types import ros_type
from .acknowledged import Acknowledged
from .publishers import publisher

TOPICS = {
    ODOMETRY: ('nav_msgs/msg/Odometry', 10),
    POSE: ('geometry_msgs/msg/PoseStamped', 10),
    # a pose graph wants every edge
    RELATIVE_POSE: ('nav_msgs/msg/Odometry', 100),
    CORRESPONDENCES: ('visualization_msgs/msg/MarkerArray', 1),
}
"""Topic to type and depth of the queue."""
MAP_TOPICS = {
    LOOP_CLOSURE: ('nav_msgs/msg/Odometry', 100),
    PATH: ('nav_msgs/msg/Path', 1),
    MAP_CLOUD: ('sensor_msgs/msg/PointCloud2', 1),
    HYPOTHESES: ('geometry_msgs/msg/PoseArray', 10),
}
"""The same where loops are closed."""
EDGES = (RELATIVE_POSE, LOOP_CLOSURE)
"""Of a pose graph, which should have all."""
FOR_LISTENERS = (CORRESPONDENCES, PATH, MAP_CLOUD)
"""Dear, so only made where somebody listens."""

TF_DEPTH = 100
"""As tf2's broadcaster has it."""


class TopicSink:
    """Publishes what the pipeline makes; a `MessageSink` for the worker's thread.

    Parameters
    ----------
    node : Node
    tf : bool
        Whether to publish the transform of the odometry on /tf, too.
    loops : bool
        Whether loops are closed.

    Raises
    ------
    InputError
        There is no tf2_msgs, or a QoS override with a value that is none.
    """

    types = staticmethod(ros_type)

    def __init__(self, node: Node, tf: bool, loops: bool = False) -> None:
        topics = TOPICS | (MAP_TOPICS if loops else {})
        self._publishers = {topic: publisher(node, ros_type(kind), topic, depth)
                            for topic, (kind, depth) in topics.items()}
        self._edges = {topic: Acknowledged(self._publishers[topic])
                       for topic in EDGES if topic in self._publishers}
        if tf:
            self._publishers[TF] = publisher(node, _tf_message(), TF, TF_DEPTH)

    def wants(self, topic: str) -> bool:
        """Whether a topic is published, and somebody listens where it is dear to make."""
        return topic in self._publishers and (
            topic not in FOR_LISTENERS or self._publishers[topic].get_subscription_count() > 0)

    def write(self, topic: str, message: Any, arrived_ns: int) -> None:
        """Publish a message."""
        if topic in self._edges:
            self._edges[topic].expect_one()
        self._publishers[topic].publish(message)

    @property
    def unacknowledged_edges(self) -> int:
        """Edges that left the queue before each reliable subscriber had acknowledged them."""
        return sum(edges.overdue for edges in self._edges.values())


def _tf_message() -> Any:
    try:
        return ros_type('tf2_msgs/msg/TFMessage')
    except ModuleNotFoundError as error:
        raise InputError('publish_tf = True: the package tf2_msgs is not installed; '
                         'apt install ros-jazzy-tf2-msgs') from error
