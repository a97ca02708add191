"""`sgor_warm_up`: compile everything now, so that no start waits for it."""
from argparse import Namespace
import sys

from ..core.warmup import compiled
from ..core.warmup import warm_up
from .command_line import OK
from .command_line import Parser
from .command_line import run


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(_warm_up, _parser().parse_args(argv))


def _parser() -> Parser:
    return Parser('sgor_warm_up', '[options]', 'Compile everything for this machine, once. Run by '
                  'whoever installed the package, it spares all users of the machine the first '
                  'wait. What is damaged in the cache is compiled again.', ('sgor_warm_up',))


def _warm_up(_: Namespace) -> int:
    warm_up()
    print('compiled' if compiled() else 'compiled, but it cannot be kept: no folder to write to')
    return OK


if __name__ == '__main__':
    sys.exit(main())
