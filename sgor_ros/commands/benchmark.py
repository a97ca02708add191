"""`sgor_benchmark`: SGOR and its rivals on the same scans in the same run."""
from argparse import ArgumentParser
from argparse import ArgumentTypeError
from argparse import Namespace
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import asdict
import importlib.util
import os
from pathlib import Path
import sys
from typing import Any

import numpy as np

from ..core.config import SgorConfig
from ..core.settings import InputError
from ..evaluation import pairs as pairing
from ..evaluation import plots
from ..evaluation import report
from ..evaluation import run as running
from ..evaluation import sequences
from ..evaluation import solver
from ..evaluation.pairs import Drive
from ..evaluation.pairs import Pair
from ..evaluation.run import Method
from ..evaluation.run import sgor
from .options import parser
from .options import run

WORLD_SEEDS = (0, 1)
WORLD_SCANS, WORLD_SPEED = 40, 45.0
"""Of the pairs: scans 4.5 m apart, half way around the loop."""

# what is beyond the paper, turned off
WITHOUT: tuple[dict[str, Any], ...] = (
    {'match_within_labels': False}, {'height_gate': 0.0}, {'context_weight': 0.0},
    {'cloud_check': False}, {'robust_ground': False}, {'drop_ground_labels': False},
    {'quick_keypoints': 0}, {'local_refinement': False}, {'refinement_rounds': 1},
    {'moving_vote': True})
# ablations 1, 3, 5, 6 and 8 of the paper
PAPER_WITHOUT: tuple[dict[str, Any], ...] = (
    {'correspondence_preprocessing': False}, {'secondary_ground': False}, {'semantics': 'none'},
    {'semantics': 'hard'}, {'ground_check': False})

DENSE_REFERENCE = Path(__file__).parents[2] / 'test/dense_reference.py'


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    arguments = _parser().parse_args(argv)
    with _cores(arguments.cores):
        return run(arguments.command, arguments)


def pairs(arguments: Namespace) -> int:
    """Compare methods on pairs."""
    methods = _methods(arguments)
    drives = _drives(arguments)
    right = _right_pairs(arguments, drives, arguments.limit)
    wrong = pairing.wrong_pairs(drives, arguments.wrong, arguments.seed)
    rows = running.run_pairs(right, methods, arguments.seed)
    refusing = [method for method in methods if method.refuses]
    if wrong and refusing:
        rows += running.run_pairs(wrong, refusing, arguments.seed)
    memory = running.peak_memory_mb(methods, running.sample_of(right[0], arguments.seed)[0])
    names = [method.name for method in methods]
    text = '\n\n'.join((
        report.pairs_table(rows, names, memory), report.data_sets_table(rows, names), report.RULE
        + ' Peak memory: of a process of its own for each method, its libraries included; '
        f'{memory[""]:.0f} MB of it are Python with numpy, scipy, numba and the two scans.'))
    _finish(arguments, text, [asdict(row) for row in rows], len(right), len(wrong))
    plots.plot_pairs(arguments.output / 'plot.png', rows, names)
    return 0


def wrong(arguments: Namespace) -> int:
    """Show how far confidence tells right from wrong."""
    config = _config(arguments)
    drives = _drives(arguments)
    right = _right_pairs(arguments, drives, arguments.limit)
    strangers = pairing.wrong_pairs(drives, arguments.count, arguments.seed)
    if not strangers:
        raise InputError('no wrong pairs: they need two drives, or one longer than '
                         f'{pairing.NO_OVERLAP_M:g} m; add --world')
    rows = running.run_pairs(right + strangers, [sgor('SGOR', config)], arguments.seed)
    thresholds = sorted({*np.arange(0.4, 1.0, 0.05).round(2), config.min_confidence})
    text = (report.confidence_table(rows, thresholds, config.min_confidence) + '\n\n'
            f'{len(right)} right and {len(strangers)} wrong pairs. Answers that the default '
            'threshold refused keep the confidence that they were refused with.')
    _finish(arguments, text, [asdict(row) for row in rows], len(right), len(strangers))
    plots.plot_confidence(arguments.output / 'confidence.png', rows, config.min_confidence)
    return 0


def ablation(arguments: Namespace) -> int:
    """Turn the mechanisms off, one at a time."""
    config = _config(arguments)
    paper = _paper(arguments)
    methods = [sgor('default', config),
               *(sgor(_name(change), config.replace(**change)) for change in WITHOUT),
               sgor('paper', paper),
               *(sgor(f'paper, {_name(change)}', paper.replace(**change))
                 for change in PAPER_WITHOUT)]
    right = _right_pairs(arguments, _drives(arguments), arguments.pairs)
    rows = running.run_pairs(right, methods, arguments.seed)
    names = [method.name for method in methods]
    counts = {data_set: sum(pair.data_set == data_set for pair in right)
              for data_set in sorted({pair.data_set for pair in right})}
    text = (report.ablation_table(rows, names) + f'\n\n{len(right)} pairs ('
            + ', '.join(f'{count} {name}' for name, count in counts.items())
            + f'). {report.RULE}')
    _finish(arguments, text, [asdict(row) for row in rows], len(right), 0)
    plots.plot_ablation(arguments.output / 'plot.png', rows, names)
    return 0


def sequence(arguments: Namespace) -> int:
    """Compare odometries on drives."""
    config = _config(arguments)
    drives = [drive for drive in _data_drives(arguments) if drive.T_world_sensor is not None
              and drive.heights_known and len(drive.frames) > 1]
    drives = [Drive(drive.name, drive.frames[:arguments.scans], drive.T_world_sensor)
              for drive in drives]
    if _wants_world(arguments):
        drives.append(_world(arguments.seed, arguments.scans, arguments.speed))
    if not drives:
        raise InputError(f'{arguments.data}: no drive with poses.txt and at least two scans')
    makers = sequences.odometries(config, _say)
    tracks = [track for drive in drives for track in sequences.run_drive(drive, makers, config)]
    _finish(arguments, report.sequence_table(tracks), report.scan_records(tracks), 0, 0)
    plots.plot_sequences(arguments.output / 'plot.png', tracks)
    return 0


def solve(arguments: Namespace) -> int:
    """Time the solver against the count of correspondences."""
    sets = [solver.made_up(count, arguments.inlier_share, arguments.seed)
            for count in arguments.counts]
    small = [matches for matches in sets if len(matches.source) <= arguments.dense_limit]
    if arguments.data:
        sets += solver.real_matches(arguments.data)
    rows = solver.run_solver(sets, _config(arguments), arguments.runs)
    dense = _dense_reference()
    if dense is None:
        _say('no dense reference here: it is part of the tests, which are not installed')
    elif small:
        rows += solver.run_dense(small, dense)
    _finish(arguments, report.solver_table(rows), [asdict(row) for row in rows], 0, 0)
    plots.plot_solver(arguments.output / 'plot.png', rows)
    return 0


def _parser() -> ArgumentParser:
    top = parser('Measure SGOR and its rivals on your own data or on the built-in world. Each '
                 'command prints a table and writes table.md, rows.csv, run.json and a plot.')
    commands = top.add_subparsers(required=True, metavar='COMMAND')
    one = _add(commands, pairs, 'pairs', 'registration of pairs: recall, errors, time, memory, '
               'false accepts')
    one.add_argument('--methods', nargs='+', metavar='NAME', help='of sgor, paper, '
                     'kiss-matcher-0.3, kiss-matcher-0.5, ransac, fgr; default: all installed')
    one.add_argument('--label-noise', type=_share, metavar='SHARE',
                     help='also run SGOR with this share of all labels random')
    one.add_argument('--no-labels', action='store_true', help='also run SGOR without labels')
    one.add_argument('--wrong', type=int, default=50, help='pairs of different places, to see '
                     'what is accepted of them')
    two = _add(commands, wrong, 'wrong', 'how far confidence tells wrong pairs from right ones')
    two.add_argument('--count', type=int, default=500, help='wrong pairs')
    for command in (one, two):
        command.add_argument('--limit', type=_positive, default=300, help='right pairs, chosen at '
                             'random and evenly over the data sets')
    three = _add(commands, ablation, 'ablation', 'every mechanism off, one at a time')
    three.add_argument('--pairs', type=_positive, default=200, help='right pairs, likewise')
    for command in (one, two, three):
        command.add_argument('--max-distance', type=float, default=36.0, metavar='M',
                             help='between the sensors of a right pair')
    four = _add(commands, sequence, 'sequence', 'odometry: drift and time a scan')
    four.add_argument('--scans', type=_positive, default=120, help='of each drive')
    four.add_argument('--speed', type=float, default=6.0, metavar='M/S', help='in the world')
    five = _add(commands, solve, 'solver', 'time of the solver against the count of matches')
    five.add_argument('--counts', type=_positive, nargs='+',
                      default=[500, 1000, 2000, 4000, 8000, 20000])
    five.add_argument('--inlier-share', type=_share, default=0.02, help='of made-up matches')
    five.add_argument('--runs', type=_positive, default=20, help='for each time')
    five.add_argument('--dense-limit', type=int, default=2000,
                      help='most matches for the dense reference')
    return top


def _add(commands: Any, function: Callable[[Namespace], int], name: str, what: str
         ) -> ArgumentParser:
    formatter = parser('').formatter_class
    command: ArgumentParser = commands.add_parser(name, help=what, description=what,
                                                  formatter_class=formatter)
    command.set_defaults(command=function)
    command.add_argument('--data', type=Path, metavar='FOLDER', help='with folders velodyne, '
                         'labels and poses.txt, itself or up to two levels below, as in '
                         'SemanticKITTI; each drive a place of its own')
    command.add_argument('--world', action='store_true', help='use the built-in world; default '
                         'where there is no --data')
    command.add_argument('--seed', type=int, default=0)
    command.add_argument('--cores', type=_positive, default=2, help='of the processor, for all')
    command.add_argument('--output', type=Path, default=Path('out/benchmark') / name,
                         metavar='FOLDER')
    return command


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
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


@contextmanager
def _cores(count: int) -> Iterator[None]:
    """Hold this process, and the rivals' threads with it, to some cores."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _config(arguments: Namespace) -> SgorConfig:
    return SgorConfig(threads=arguments.cores)


def _paper(arguments: Namespace) -> SgorConfig:
    return SgorConfig.paper().replace(threads=arguments.cores)


def _methods(arguments: Namespace) -> list[Method]:
    config = _config(arguments)
    known = {'sgor': sgor('SGOR', config),
             'paper': sgor("SGOR, paper's settings", _paper(arguments)), **running.rivals(_say)}
    for name in arguments.methods or ():
        if name not in known:
            raise InputError(f'--methods {name}: not one of {", ".join(known)}')
    chosen = [known[name] for name in arguments.methods or known]
    if arguments.label_noise:
        chosen.append(sgor(f'SGOR, {arguments.label_noise:.0%} of labels random', config,
                           arguments.label_noise))
    if arguments.no_labels:
        chosen.append(sgor('SGOR, no labels', config, labels=False))
    return chosen


def _drives(arguments: Namespace) -> list[Drive]:
    drives = _data_drives(arguments)
    if _wants_world(arguments):
        drives += [_world(seed, WORLD_SCANS, WORLD_SPEED) for seed in WORLD_SEEDS]
    return drives


def _data_drives(arguments: Namespace) -> list[Drive]:
    return pairing.read_drives(arguments.data) if arguments.data else []


def _wants_world(arguments: Namespace) -> bool:
    return bool(arguments.world or not arguments.data)


def _world(seed: int, scans: int, speed: float) -> Drive:
    try:
        from ..world import simulate
    except ImportError as error:
        raise InputError(f'the built-in world needs Open3D ({error}): '
                         "pip install 'sgor_ros[benchmark]'") from error
    _say(f'building the world, seed {seed}')
    return pairing.drive_of(f'world/{seed}', (scan[1:] for scan in
                                              simulate(scans, seed, speed=speed)))


def _right_pairs(arguments: Namespace, drives: Sequence[Drive], count: int) -> list[Pair]:
    candidates = pairing.near_pairs(drives, arguments.max_distance)
    if arguments.data:
        candidates += pairing.listed_pairs(arguments.data, arguments.max_distance)
    if not candidates:
        raise InputError(f'{arguments.data}: no pairs within {arguments.max_distance:g} m; they '
                         'need poses.txt or pairs.json')
    return pairing.choose(candidates, count, arguments.seed)


def _dense_reference() -> solver.Dense | None:
    """Return the reference of the tests where this is a checkout."""
    if not DENSE_REFERENCE.is_file():
        return None
    spec = importlib.util.spec_from_file_location('dense_reference', DENSE_REFERENCE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: solver.Dense = module.solve
    return found


def _name(change: dict[str, Any]) -> str:
    return ', '.join(f'{name}={value}' for name, value in change.items())


def _finish(arguments: Namespace, text: str, records: list[dict[str, Any]], right: int,
            wrong: int) -> None:
    print(text)
    options = {name: value for name, value in vars(arguments).items() if name != 'command'}
    report.save(arguments.output, text, records, {
        'options': options, 'right_pairs': right, 'wrong_pairs': wrong,
        'config': asdict(_config(arguments))})
    _say(f'wrote {arguments.output}')


def _say(text: str) -> None:
    print(text, file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
