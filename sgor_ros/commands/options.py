"""Command line options derived from the settings."""
from argparse import BooleanOptionalAction
from argparse import Namespace
from argparse import SUPPRESS
from pathlib import Path
import sys
from typing import Any

import yaml

from ..core.common.settings import InputError
from ..core.common.settings import Setting
from ..core.common.settings import Settings
from ..core.config import SgorConfig
from ..visualize import VIEWER
from .command_line import Parser

INDOOR = 'indoor'
PRESETS = {'outdoor': SgorConfig.outdoor, INDOOR: SgorConfig.indoor, 'paper': SgorConfig.paper,
           'kitti_protocol': SgorConfig.kitti_protocol}


def add_preset(to: Parser) -> None:
    """Add the option for the settings to start from."""
    shown = [name for name in PRESETS if name != INDOOR]
    to.add_argument('--preset', choices=list(PRESETS), default='outdoor', type=_preset,
                    metavar=f'{{{",".join(shown)}}}',
                    help='settings of the registration to start from; outdoor is for any space')


def _preset(name: str) -> str:
    if name == INDOOR:
        print('warning: --preset indoor is deprecated: without it, the scale of a space is found '
              'from the scans, and more of them register', file=sys.stderr)
    return name


def add_settings(to: Parser, title: str, config: type[Settings]) -> None:
    """Add an option for each setting: ``sigma_d`` becomes ``--sigma-d``.

    ``--help`` tells those that many change. Names of before are taken and told nowhere.
    """
    shown = config.shown()
    used = to.add_argument_group(title)
    studied = to.add_argument_group(f'{title}: for studies')
    for item in config.settings():
        group = used if item in shown else studied
        details: dict[str, Any] = {'default': SUPPRESS, 'help': _help(item)}
        if item.kind is bool:
            details['action'] = BooleanOptionalAction
        else:
            details['type'] = item.kind
            details['metavar'] = item.unit or item.kind.__name__.upper()
        option = group.add_argument(_option(item.name), dest=item.name, **details)
        if not item.common:
            to.leave_out(option)
        for old in (old for old, new in config.RENAMED.items() if new == item.name):
            group.add_argument(_option(old), dest=item.name, **details | {'help': SUPPRESS})


def _option(name: str) -> str:
    return f'--{name.replace("_", "-")}'


def add_params_file(to: Parser) -> None:
    """Add the option for a YAML file as ROS nodes take it."""
    to.add_argument('--params-file', type=Path, metavar='YAML', default=SUPPRESS,
                    help='settings in the format of ROS parameter files; options go before')


def add_labels(to: Parser) -> None:
    """Add the option for the labels of a folder of scans."""
    to.add_argument('--labels', type=Path, metavar='FOLDER', help='with a .label for each scan of '
                    'a folder, by its name: a path, or one beside the scans such as '
                    'predicted_labels; default: the best that there are')


def add_visualize(to: Parser) -> None:
    """Add the option for a live look."""
    to.add_argument('-v', '--visualize', nargs='?', const=VIEWER, default=None, metavar='FILE.rrd',
                    help='write what rerun shows to this file; without a file open its viewer')


def configured[S: Settings](start: S, arguments: Namespace, parameters: dict[str, Any]) -> S:
    """Return `start` changed by the parameters of a file and, before those, by options.

    Raises
    ------
    InputError
        A value that is refused.
    """
    named = start.current(parameters)
    changed = {}
    for item in start.settings():
        option = getattr(arguments, item.name, None)
        if option is not None:
            changed[item.name] = option
        elif item.name in named:
            changed[item.name] = named[item.name]
    return start.replace(**changed)


def read_parameters(arguments: Namespace, *known: type[Settings]) -> dict[str, Any]:
    """Return the parameters of the ROS YAML file, of all its nodes together, if one was given.

    Names that are no settings of the `known` configurations get a warning: the file may serve a
    node, which has more, or the name may be misspelt.

    Raises
    ------
    InputError
        No such file, or one of another format.
    """
    path = getattr(arguments, 'params_file', None)
    if path is None:
        return {}
    try:
        content = yaml.safe_load(path.read_text())
        nodes = [node['ros__parameters'] for node in content.values()]
        parameters = {name: value for node in nodes for name, value in node.items()}
    # a date that is none is a ValueError, as is text that is not UTF-8
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise InputError(f'--params-file {path}: cannot be read: {error}') from error
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f'--params-file {path}: expected "/**: ros__parameters:" and settings '
                         'below it') from error
    names = {name for config in known
             for name in (*(item.name for item in config.settings()), *config.RENAMED)}
    unknown = sorted(map(str, parameters.keys() - names))
    if unknown:
        print(f'warning: {path}: no settings of this command, so ignored: {", ".join(unknown)}',
              file=sys.stderr)
    return parameters


def _help(item: Setting) -> str:
    bounds = [f'at least {item.minimum:g}' if item.minimum is not None else '',
              f'at most {item.maximum:g}' if item.maximum is not None else '']
    default = f'{item.default:.6g}' if item.kind is float else str(item.default)
    details = ', '.join(filter(None, [*bounds, f'default {default}' if default else '']))
    return '; '.join(filter(None, (item.description, details))).replace('%', '%%')
