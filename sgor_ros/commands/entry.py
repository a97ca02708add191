"""The executables: each decides where compiled code is kept, then loads its command.

A command whose packages are missing says what to install, before anything else can fail.
"""
from collections.abc import Callable
from importlib import import_module
import sys

from ..core.execution.cache import choose_cache_folder
from .command_line import REFUSED

EXTRA = ('matplotlib', 'rosbags', 'tqdm', 'yaml')
"""What commands import and the library does not: the extra ``commands``."""


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
