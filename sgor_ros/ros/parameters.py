"""ROS parameters and their YAML files, derived from the settings and from nothing else.

``python -m sgor_ros.ros.parameters`` prints ``config/sgor_node.yaml``; with a folder as argument
it writes that file and the presets there.
"""
from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import replace
from itertools import chain
import math
from pathlib import Path
import sys
import textwrap

from rcl_interfaces.msg import FloatingPointRange
from rcl_interfaces.msg import IntegerRange
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..core.common.settings import InputError
from ..core.common.settings import Setting
from ..core.common.settings import setting
from ..core.common.settings import Settings
from ..core.common.settings import Value
from ..core.config import SgorConfig
from ..core.scan.labels import label_convention
from ..io.stream_config import StreamConfig
from ..mapping import MapperConfig
from ..tracker import TrackerConfig

LARGEST_INTEGER = 2**31 - 1
MAP_FOLDER = 'map_folder'
"""What of `NodeConfig` can be changed while the node runs."""


@dataclass(frozen=True)
class NodeConfig(StreamConfig):
    """What concerns the node's connections; fixed while it runs, but for `map_folder`."""

    reliability: str = setting(
        'auto', 'QoS of the subscription; auto: reliable, which loses no large clouds, until a '
        'publisher turns up that is best effort only', choices=('auto', 'reliable', 'best_effort'))
    loop_closure: bool = setting(
        False, 'Close loops: publish loop_closure, path and map_cloud, and with publish_tf the '
        'transform from map_frame to odom_frame; needs GTSAM', common=True)
    map_folder: str = setting(
        '', 'Folder of the map, for the services save_map and load_map; it can be changed while '
        'the node runs. A map that is there when the node starts is gone on in: the sensor is '
        'looked for in it, and map_frame is its frame. Needs loop_closure', common=True)
    localization: bool = setting(
        False, 'Follow the map of map_folder and add nothing to it, until the service '
        'set_mode_mapping is called', common=True)
    publish_tf: bool = setting(
        False, 'Publish the transform from odom_frame to base_frame, or to the sensor frame, on '
        '/tf', common=True)
    invert_tf: bool = setting(
        False, 'Publish it as a transform to odom_frame: for a base that has a parent already')


class NodeParameters:
    """The parameters of a node, declared and kept in step with the configurations.

    Attributes
    ----------
    node_config : NodeConfig
    mapper_config : MapperConfig
    live : (SgorConfig, TrackerConfig)
        The newest; replaced as a whole, so any thread may read it.
    map_folder : str
        The newest.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.node_config = NodeConfig.from_values(_declare(node, NodeConfig, read_only=True))
        self.map_folder = self.node_config.map_folder
        self.mapper_config = MapperConfig.from_values(_declare(node, MapperConfig, read_only=True))
        self.live = (SgorConfig.from_values(_declare(node, SgorConfig)),
                     TrackerConfig.from_values(_declare(node, TrackerConfig)))
        label_convention(self.live[0].label_convention)
        _warn_of_unknown(node)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse values that do not go together; rclpy has checked each type and range."""
        try:
            self._changed(parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        before = self.live
        self.live = self._changed(parameters)
        for item in parameters:
            if item.name == MAP_FOLDER:
                self.map_folder = item.value
        if self.live != before:
            changes = ', '.join(f'{item.name} = {item.value}' for item in parameters)
            self._node.get_logger().info(f'from the next scan on: {changes}')

    def _changed(self, parameters: list[Parameter]) -> tuple[SgorConfig, TrackerConfig]:
        sgor, tracker = self.live
        sgor = sgor.replace(**_values_of(sgor, parameters))
        label_convention(sgor.label_convention)
        return sgor, tracker.replace(**_values_of(tracker, parameters))


def _values_of(config: Settings, parameters: list[Parameter]) -> dict[str, Value]:
    names = [item.name for item in config.settings()]
    return {item.name: item.value for item in parameters if item.name in names}


def _declare(node: Node, config: type[Settings], read_only: bool = False) -> dict[str, Value]:
    """Declare the settings of a configuration and return the values that the user gave them.

    Those for studies are declared only where the user gives them, and so are the names of before.
    """
    given = node._parameter_overrides
    shown = config.shown()
    items = [*shown, *(item for item in config.settings()
                       if item not in shown and item.name in given)]
    before = {new: old for old, new in config.RENAMED.items() if old in given}
    for new, old in before.items():
        node.get_logger().warning(f'parameter {old}: it is {new} now')
    try:
        return {item.name: node.declare_parameter(
            item.name, given[before[item.name]].value if item.name in before else item.default,
            _descriptor(item, read_only and item.name != MAP_FOLDER)).value for item in items}
    except InvalidParameterTypeException as error:
        raise InputError(f'{error} (a double needs its point: 3.0, not 3)') from error
    except ParameterException as error:
        raise InputError(str(error)) from error


def _descriptor(item: Setting, read_only: bool) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=item.description, read_only=read_only)
    if item.choices:
        descriptor.additional_constraints = f'one of {", ".join(item.choices)}'
    if item.minimum is None and item.maximum is None:
        return descriptor
    if item.kind is float:
        descriptor.floating_point_range = [FloatingPointRange(
            from_value=-math.inf if item.minimum is None else float(item.minimum),
            to_value=math.inf if item.maximum is None else float(item.maximum))]
    else:
        descriptor.integer_range = [IntegerRange(
            from_value=-LARGEST_INTEGER if item.minimum is None else int(item.minimum),
            to_value=LARGEST_INTEGER if item.maximum is None else int(item.maximum))]
    return descriptor


def _warn_of_unknown(node: Node) -> None:
    """Name what the user set and the node does not have: rclpy drops it without a word."""
    for name in node._parameter_overrides:
        if (not node.has_parameter(name) and name not in SgorConfig.RENAMED
                and not name.startswith('qos_overrides.')):
            node.get_logger().warning(f'parameter {name}: there is none of that name; ignored')


SECTIONS: dict[str, type[Settings]] = {
    'Registration; these can be changed while the node runs': SgorConfig,
    'Tracker; these can be changed while the node runs': TrackerConfig,
    'Loops; read when it starts': MapperConfig,
    'Node; read when it starts': NodeConfig}
THE_REST = 'The rest: the defaults serve'


def yaml_files() -> dict[str, str]:
    """Return the parameter files of config/: name to content."""
    indoor = _differences(SgorConfig.indoor())
    consecutive = _differences(TrackerConfig(mode='consecutive'))
    return {
        'sgor_node.yaml': _yaml(
            'All parameters of sgor_node with their defaults: what many change, then the rest.',
            *(_section(heading, [replace(item, group='') for item in config.common()])
              for heading, config in SECTIONS.items()),
            ['', f'    # ======== {THE_REST} ========'],
            *(_section(heading, [item for item in config.shown() if not item.common])
              for heading, config in SECTIONS.items())),
        'indoor.yaml': _yaml(
            'Deprecated: the defaults find the scale of a room, and register more scans of it.',
            _section('SgorConfig.indoor()', _named(SgorConfig, indoor), indoor)),
        'consecutive.yaml': _yaml(
            'Register each scan to the one before: what differs from the defaults.',
            _section('Tracker', _named(TrackerConfig, consecutive), consecutive))}


def _differences(config: Settings) -> dict[str, Value]:
    defaults = asdict(type(config)())
    return {name: value for name, value in asdict(config).items() if value != defaults[name]}


def _named(config: type[Settings], names: Iterable[str]) -> list[Setting]:
    return [item for item in config.settings() if item.name in names]


def _yaml(title: str, *sections: list[str]) -> str:
    return '\n'.join((
        f'# {title}', '# Made by `python -m sgor_ros.ros.parameters config`. Doubles need their '
        'point: 3.0, not 3.', '/**:', '  ros__parameters:', *chain(*sections))) + '\n'


def _section(heading: str, settings: Iterable[Setting], values: Mapping[str, Value] | None = None
             ) -> list[str]:
    lines: list[str] = []
    group = None
    for item in settings:
        if item.group != group:
            group = item.group
            lines += ['', f'    # ---- {heading}{group and f": {group}"} ----']
        lines += textwrap.wrap(item.description + _bounds(item), 99, initial_indent='    # ',
                               subsequent_indent='    # ')
        lines.append(f'    {item.name}: {_scalar((values or {}).get(item.name, item.default))}')
    return lines


def _bounds(item: Setting) -> str:
    if item.minimum is None or item.maximum is None:
        return ''
    return f'; from {item.minimum:.6g} to {item.maximum:.6g}'


def _scalar(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else repr(value)


if __name__ == '__main__':
    if len(sys.argv) > 1:
        for file_name, content in yaml_files().items():
            (Path(sys.argv[1]) / file_name).write_text(content)
    else:
        print(yaml_files()['sgor_node.yaml'], end='')
