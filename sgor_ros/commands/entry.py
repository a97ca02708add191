"""The executables: each decides where compiled code is kept, then loads its command.

A command whose packages are missing says what to install, before anything else can fail.
"""
from collections.abc import Callable
from importlib import import_module
import sys

from ..core.execution.cache import choose_cache_folder
from .command_line import Parser
from .command_line import REFUSED

EXTRA = ('matplotlib', 'rich', 'rosbags', 'yaml')
"""What commands import and the library does not: the extra ``commands``."""

COMMANDS = {
    'register': 'register two scans from files',
    'replay': 'track the clouds of a bag, or the scans of a folder, without ROS',
    'map': 'build maps that stay, find scans in them, merge, export and show them',
    'kitti-to-bag': 'make a bag of a SemanticKITTI sequence',
    'benchmark': 'measure SGOR beside other methods',
    'tables': 'the tables and studies of the paper',
    'demo': 'play the built-in world to the node, and compare with the truth',
    'node': 'the ROS 2 node',
    'warm-up': 'compile everything now, so that no start waits for it'}
"""What `sgor` runs, each of them a command ``sgor_NAME`` too."""


def _entry(module: str) -> Callable[[], int]:
    def main() -> int:
        choose_cache_folder()
        try:
            command = import_module(f'{__package__}.{module}')
        except ModuleNotFoundError as error:
            missing = (error.name or '').partition('.')[0]
            if missing not in EXTRA:
                raise
            print(f"error: sgor_{module} needs {missing}: pip install 'sgor_ros[commands]', in a "
                  "checkout '.[commands]'", file=sys.stderr)
            return REFUSED
        code: int = command.main()
        return code
    return main


benchmark = _entry('benchmark')
demo = _entry('demo')
kitti_to_bag = _entry('kitti_to_bag')
map = _entry('map')
register = _entry('register')
replay = _entry('replay')
tables = _entry('tables')
warm_up = _entry('warm_up')


def _node() -> int:
    from ..ros.main import main

    return main()


def sgor() -> int:
    """Run the command that the first argument names, with the arguments after it."""
    top = Parser(
        'sgor', 'COMMAND [options]', 'LiDAR registration without an initial guess, and odometry, '
        'loops and maps on it. `sgor COMMAND --help` tells the options. Each is a command of its '
        'own too: sgor_replay, sgor_register, ...',
        ('sgor register a.ply b.ply', 'sgor replay bags/drive --output out/drive',
         'sgor benchmark pairs --world'))
    commands = top.add_subparsers(required=True, dest='command', metavar='COMMAND')
    for name, does in COMMANDS.items():
        commands.add_parser(name, help=does, prog=f'sgor {name}')
    name = top.parse_args([word.replace('_', '-') for word in sys.argv[1:2]]).command
    command = f'sgor_{name.replace("-", "_")}'
    # as if it had been called by that name
    sys.argv[:2] = [command]
    return _node() if name == 'node' else _entry(command.removeprefix('sgor_'))()
