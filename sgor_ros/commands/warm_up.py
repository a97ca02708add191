"""`sgor_warm_up`: compile everything now, so that no start waits for it."""
import argparse
import sys

from ..core.warmup import compiled
from ..core.warmup import warm_up


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    argparse.ArgumentParser(
        prog='sgor_warm_up', description='Compile everything for this machine, once. Run by '
        'whoever installed the package, it spares all users of the machine the first wait.'
    ).parse_args(argv)
    warm_up()
    print('compiled' if compiled() else 'compiled, but it cannot be kept: no folder to write to')
    return 0


if __name__ == '__main__':
    sys.exit(main())
