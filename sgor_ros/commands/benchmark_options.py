"""Options of `sgor_benchmark`."""
from argparse import ArgumentDefaultsHelpFormatter
from argparse import ArgumentParser
from argparse import ArgumentTypeError
from pathlib import Path
from typing import Any

from .options import parser


def benchmark_parser() -> ArgumentParser:
    """Return the parser; `command` of what it parses is the name of the subcommand."""
    top = parser('Measure SGOR and its rivals on your own data or on the built-in world. Each '
                 'command prints a table and writes table.md, rows.csv, run.json and a plot.')
    commands = top.add_subparsers(required=True, dest='command', metavar='COMMAND')
    one = _add(commands, 'pairs', 'registration of pairs: recall, errors, time, memory, '
               'false accepts')
    one.add_argument('--methods', nargs='+', metavar='NAME', help='of sgor, paper, '
                     'kiss-matcher-0.3, kiss-matcher-0.5, ransac, fgr; default: all installed')
    one.add_argument('--label-noise', type=_share, metavar='SHARE',
                     help='also run SGOR with this share of all labels random')
    one.add_argument('--no-labels', action='store_true', help='also run SGOR without labels')
    one.add_argument('--wrong', type=_count, default=50, help='pairs of different places, to see '
                     'what is accepted of them')
    two = _add(commands, 'wrong', 'what is claimed and wrong: confidence of right '
               'and wrong pairs, and what becomes of places that repeat themselves')
    two.add_argument('--count', type=_count, default=500, help='wrong pairs')
    two.add_argument('--per-kind', type=_count, default=10, metavar='COUNT', help='pairs of the '
                     'same place, and of different places, of each kind in the built-in world: '
                     'tunnels, corridors, facades and others that repeat themselves')
    for command, whole in ((one, _positive), (two, _count)):
        command.add_argument('--limit', type=whole, default=300, help='right pairs, chosen at '
                             'random and evenly over data sets and distances')
    three = _add(commands, 'ablation', 'every mechanism off, one at a time')
    three.add_argument('--pairs', type=_positive, default=200, help='right pairs, likewise')
    three.add_argument('--paper', action='store_true', help="only the rows of the paper's table "
                       'and its other readings')
    four = _add(commands, 'sequence', 'odometry: drift, time a scan, and '
                'whether its covariance holds')
    four.add_argument('--scans', type=_count, default=120, help='of each drive, and of the '
                      'street of the built-in world; 0: none')
    four.add_argument('--per-kind', type=_count, default=40, metavar='COUNT', help='scans of a '
                      'drive through each other kind of place in the built-in world; 0: none')
    four.add_argument('--no-labels', action='store_true', help='also track without labels')
    for command in (two, four):
        command.add_argument('--kinds', nargs='+', metavar='KIND', help='of those; default: all')
    four.add_argument('--speed', type=float, default=6.0, metavar='M/S', help='in the world')
    five = _add(commands, 'solver', 'time of the solver on made-up matches, and on those of the '
                'FPFH of your scans')
    five.add_argument('--counts', type=_positive, nargs='+',
                      default=[1000, 2000, 4000, 8000, 16000, 30000], help='of made-up matches')
    five.add_argument('--pairs', type=_positive, default=8, help='of scans whose FPFH is matched, '
                      'with --data or --world')
    five.add_argument('--fpfh-matches', type=_positive, default=8000, metavar='COUNT',
                      help='most of a pair')
    five.add_argument('--inlier-share', type=_share, default=0.02, help='of made-up matches')
    five.add_argument('--runs', type=_positive, default=20, help='for each time')
    five.add_argument('--dense-limit', type=_count, default=2000,
                      help='most matches for the dense reference')
    for command in (one, two, three, five):
        command.add_argument('--max-distance', type=float, default=36.0, metavar='M',
                             help='between the sensors of a right pair')
    return top


def _add(commands: Any, name: str, what: str) -> ArgumentParser:
    command: ArgumentParser = commands.add_parser(name, help=what, description=what,
                                                  formatter_class=ArgumentDefaultsHelpFormatter)
    command.add_argument('--data', type=Path, metavar='FOLDER', help='of drives with poses, '
                         'itself or up to two levels below, as in SemanticKITTI (other layouts: '
                         'docs/data.md); each drive a place of its own')
    command.add_argument('--world', action='store_true', help='use the built-in world; default '
                         'where there is no --data')
    command.add_argument('--seed', type=int, default=0)
    command.add_argument('--cores', type=_positive, default=2, help='of the processor, for all')
    command.add_argument('--output', type=Path, default=Path('out/benchmark') / name,
                         metavar='FOLDER')
    return command


def _count(text: str) -> int:
    if not text.isdecimal():
        raise ArgumentTypeError(f'{text!r}: expected a whole number')
    return int(text)


def _positive(text: str) -> int:
    if _count(text) == 0:
        raise ArgumentTypeError(f'{text!r}: expected a whole number from 1')
    return int(text)


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1:
        raise ArgumentTypeError(f'{text!r}: expected a number from 0 to 1')
    return value
