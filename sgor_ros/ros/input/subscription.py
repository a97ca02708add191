"""The subscription to `points`: QoS that fits the publisher, and a word when nothing comes."""
from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.qos import QoSPolicyKind
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2

from ...core.common.settings import InputError
from ..output.publishers import OVERRIDE_ERRORS
from ..output.publishers import PREFIX

# taken at once, so this only bridges the moments in which the receiving thread has to wait
DEPTH = 5
# the reliability has a parameter of its own
OVERRIDES = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH)
PATIENCE_S = 5.0
REMINDER_S = 30.0


def override_names(node: Node) -> list[str]:
    """Return the QoS overrides that the subscription asks for."""
    topic = node.resolve_topic_name('points')
    return [f'{PREFIX}{topic}.subscription.{kind.name.lower()}' for kind in OVERRIDES]


class CloudSubscription:
    """Receives the clouds of `points` and hands each to `on_cloud`, on the executor's thread."""

    def __init__(self, node: Node, reliability: str, on_cloud: Callable[[PointCloud2], None]
                 ) -> None:
        self._node = node
        self._on_cloud = on_cloud
        self._may_relax = reliability == 'auto'
        self._heard = False
        self._heard_ever = False
        self._subscription = self._subscribe(
            ReliabilityPolicy.BEST_EFFORT if reliability == 'best_effort'
            else ReliabilityPolicy.RELIABLE)
        # the wall's time, not the bag's: silence must be noticed when /clock is silent too
        node.create_timer(PATIENCE_S, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _subscribe(self, reliability: ReliabilityPolicy) -> Subscription:
        try:
            return self._node.create_subscription(
                PointCloud2, 'points', self._receive,
                QoSProfile(depth=DEPTH, reliability=reliability),
                event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible),
                qos_overriding_options=QoSOverridingOptions(OVERRIDES))
        except OVERRIDE_ERRORS as error:
            raise InputError(f'{PREFIX}{self._node.resolve_topic_name("points")}: {error}'
                             ) from error

    def _receive(self, message: PointCloud2) -> None:
        self._heard = self._heard_ever = True
        self._on_cloud(message)

    def _on_incompatible(self, event: QoSRequestedIncompatibleQoSInfo) -> None:
        topic, log = self._subscription.topic_name, self._node.get_logger()
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        if self._may_relax and policy == 'RELIABILITY':
            self._may_relax = False
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe(ReliabilityPolicy.BEST_EFFORT)
            log.warning(f'a publisher of {topic} is best effort only: subscribed best effort. '
                        'Clouds of more than 0.5 MB may get lost on the way unless the middleware '
                        'is given more shared memory')
        else:
            log.error(f'incompatible QoS ({policy}): nothing will arrive from a publisher of '
                      f'{topic}; reliability = auto or best_effort takes clouds from any')

    def _watch(self) -> None:
        """Say that nothing came, and what there is to listen to."""
        heard, self._heard = self._heard, False
        if heard:
            return
        topic = self._subscription.topic_name
        others = [name for name, kinds in self._node.get_topic_names_and_types()
                  if 'sensor_msgs/msg/PointCloud2' in kinds and name != topic]
        silence = f'for {PATIENCE_S:.0f} s' if self._heard_ever else 'yet'
        self._node.get_logger().warning(
            f'no clouds on {topic} {silence}; {self._node.count_publishers(topic)} publishers; '
            f'other topics with clouds: {", ".join(others) or "none"}',
            throttle_duration_sec=REMINDER_S)
