"""Publishers whose QoS the user may override: qos_overrides.TOPIC.publisher.POLICY."""
from collections.abc import Iterable

from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import InvalidQosOverridesError
from rclpy.qos_overriding_options import QoSOverridingOptions

from ...core.common.settings import InputError

PREFIX = 'qos_overrides.'
# what rclpy raises for values that make no sense
OVERRIDE_ERRORS = (InvalidQosOverridesError, ParameterException, RuntimeError, ValueError)


def publisher(node: Node, kind: type, topic: str, depth: int) -> Publisher:
    """Return a reliable publisher, or what the user's overrides make of it.

    Raises
    ------
    InputError
        An override with a value that is none.
    """
    try:
        return node.create_publisher(
            kind, topic, depth,
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
    except OVERRIDE_ERRORS as error:
        raise InputError(f'{PREFIX}{node.resolve_topic_name(topic)}: {error}') from error


def refuse_unknown_overrides(node: Node, later: Iterable[str]) -> None:
    """Refuse overrides of the node's own topics that do nothing, once its publishers are made.

    Those of other topics may be for another node that reads the same file: they get a warning.

    Parameters
    ----------
    node : Node
    later : iterable of str
        Names of overrides that will be asked for later.

    Raises
    ------
    InputError
    """
    topics = {name for name, _ in node.get_publisher_names_and_types_by_node(
        node.get_name(), node.get_namespace())} | {node.resolve_topic_name('points')}
    for name in node._parameter_overrides:
        if not name.startswith(PREFIX) or name in later or node.has_parameter(name):
            continue
        topic, _, policy = name.removeprefix(PREFIX).partition('.')
        if topic in topics:
            hint = ': there is the parameter reliability' if policy.endswith('reliability') else ''
            raise InputError(f'{name}: it cannot be overridden{hint}')
        node.get_logger().warning(f'parameter {name}: there is no such topic; ignored')
