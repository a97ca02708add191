"""`sgor_benchmark`: SGOR and other methods on the same scans in the same run."""
from argparse import ArgumentParser
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import sys
from typing import Protocol

from ..core.warmup import warm_up
from ..io.writing import free_folder
from ..io.writing import new_folder
from .benchmarks import ablation
from .benchmarks import calibrate
from .benchmarks import loops
from .benchmarks import pairs
from .benchmarks import sequence
from .benchmarks import solver
from .benchmarks import wrong
from .benchmarks.inputs import default_config
from .benchmarks.inputs import say
from .benchmarks.numbers import positive
from .command_line import OK
from .command_line import Parser
from .command_line import run


class Benchmark(Protocol):
    """What a module in `benchmarks` holds."""

    HELP: str

    def add_options(self, command: ArgumentParser) -> None:
        """Add its own options."""

    def measure(self, arguments: Namespace, folder: Path) -> None:
        """Print a table and write it, its rows and a plot into `folder`, which is not there."""


# a new one: a module in benchmarks/, and a line here
COMMANDS: dict[str, Benchmark] = {
    'pairs': pairs, 'wrong': wrong, 'calibrate': calibrate, 'ablation': ablation,
    'sequence': sequence, 'loops': loops, 'solver': solver}


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    return run(measure, _parser().parse_args(argv))


def measure(arguments: Namespace) -> int:
    """Run one of the benchmarks on some cores, into a folder of its own."""
    output = arguments.output or free_folder(Path('out/benchmark') / arguments.command)
    with _cores(arguments.cores), new_folder(output, part=True) as place:
        warm_up(default_config(arguments))
        try:
            COMMANDS[arguments.command].measure(arguments, place)
        except BaseException:
            if place.is_dir():
                say(f'what was measured until now is in {output}')
            raise
    say(f'wrote {output}')
    return OK


def _parser() -> Parser:
    top = Parser(
        'sgor_benchmark', 'COMMAND [options]', 'Measure SGOR and other methods on your own data '
        'or on the built-in world. Each command prints a table and writes table.md, rows.csv, '
        'run.json and a plot into a new folder.',
        ('sgor_benchmark pairs --world', 'sgor_benchmark sequence --data sequences/08',
         'sgor_benchmark wrong --help'))
    commands = top.add_subparsers(required=True, dest='command', metavar='COMMAND')
    for name, benchmark in COMMANDS.items():
        command = commands.add_parser(
            name, help=benchmark.HELP, prog=f'sgor_benchmark {name}', usage='[options]',
            description=f'{benchmark.HELP[0].upper()}{benchmark.HELP[1:]}.',
            examples=(f'sgor_benchmark {name} --world',
                      f'sgor_benchmark {name} --data DATA --output out/mine'))
        _add_common(command)
        benchmark.add_options(command)
    return top


def _add_common(command: ArgumentParser) -> None:
    command.add_argument('--data', type=Path, metavar='FOLDER', help='of drives with poses, '
                         'itself or up to two levels below, as in SemanticKITTI (other layouts: '
                         'docs/data.md); each drive a place of its own')
    command.add_argument('--world', action='store_true', help='use the built-in world; default '
                         'where there is no --data')
    command.add_argument('--seed', type=int, default=0, help='chooses pairs, turns and noise')
    command.add_argument('--cores', type=positive, default=2, help='of the processor, for all')
    command.add_argument('-o', '--output', type=Path, metavar='FOLDER', help='for the results, '
                         'must not exist; default: out/benchmark/COMMAND, and _2, _3, ... behind '
                         'it where that exists')


@contextmanager
def _cores(count: int) -> Iterator[None]:
    """Hold this process, and the threads of all methods with it, to some cores."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


if __name__ == '__main__':
    sys.exit(main())
