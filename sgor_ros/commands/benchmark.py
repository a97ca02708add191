"""`sgor_benchmark`: SGOR and its rivals on the same scans in the same run."""
from argparse import Namespace
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

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from ..evaluation import ablation as ablations
from ..evaluation import pairs as pairing
from ..evaluation import plots
from ..evaluation import report
from ..evaluation import run as running
from ..evaluation import sequences
from ..evaluation import solver
from ..evaluation import trust
from ..evaluation.honesty_table import honesty_table
from ..evaluation.honesty_table import RULE
from ..evaluation.pairs import Pair
from ..evaluation.run import Method
from ..evaluation.run import sgor
from ..evaluation.trust_plots import plot_reliability
from ..io.datasets import Drive
from ..io.datasets import open_drives
from .benchmark_options import benchmark_parser
from .options import run
from .scene_pairs import scene_drive
from .scene_pairs import scene_kinds
from .scene_pairs import scene_pairs

WORLD_SEEDS = (0, 1)
WORLD_SCANS, WORLD_SPEED = 40, 45.0
"""Of the pairs: scans 4.5 m apart, half way around the loop."""

DENSE_REFERENCE = Path(__file__).parents[2] / 'test/dense_reference.py'


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    arguments = benchmark_parser().parse_args(argv)
    with _cores(arguments.cores):
        return run(COMMANDS[arguments.command], arguments)


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
    """Show how far confidence tells right from wrong, and what is known not to be known."""
    config = _config(arguments)
    methods = [sgor('SGOR', config), sgor('SGOR, no labels', config, labels=False)]
    names = [method.name for method in methods]
    kinds = (scene_kinds(arguments.kinds or ())
             if _wants_world(arguments) and arguments.per_kind else {})
    rows, texts = [], []
    if arguments.limit or arguments.count:
        rows = running.run_pairs(_right_and_wrong(arguments), methods, arguments.seed)
        labelled = [row for row in rows if row.method == names[0]]
        thresholds = sorted({*np.arange(0.4, 1.0, 0.05).round(2), config.min_confidence})
        texts.append(report.confidence_table(labelled, thresholds, config.min_confidence)
                     + f'\n\n{sum(row.right for row in labelled)} right and '
                     f'{sum(not row.right for row in labelled)} wrong pairs. Answers that the '
                     'default threshold refused keep the confidence that they were refused with.')
    elif not kinds:
        raise InputError('--limit 0 --count 0: nothing is left to do without --per-kind')
    for number, kind in enumerate(kinds, 1):
        _say(f'{kind}, {number} of {len(kinds)} kinds: scanning')
        rows += running.run_pairs(scene_pairs(kind, arguments.per_kind, arguments.seed), methods,
                                  arguments.seed)
    repeating = [kind for kind, repeats in kinds.items() if repeats]
    texts += [trust.trust_table(rows, names, repeating), trust.RULE,
              trust.verdicts(rows, names), trust.reliability_table(rows, names)]
    right = sum(row.right for row in rows) // len(methods)
    _finish(arguments, '\n\n'.join(texts), [asdict(row) for row in rows], right,
            len(rows) // len(methods) - right)
    if arguments.limit or arguments.count:
        plots.plot_confidence(arguments.output / 'confidence.png', labelled,
                              config.min_confidence)
    plot_reliability(arguments.output / 'reliability.png', rows, names, config.min_confidence)
    return 0


def ablation(arguments: Namespace) -> int:
    """Turn the mechanisms off, one at a time, as the paper does and ours too."""
    methods = ablations.methods(arguments.cores, only_paper=arguments.paper)
    right = _right_pairs(arguments, _drives(arguments), arguments.pairs)
    rows = running.run_pairs(right, methods, arguments.seed)
    names = [method.name for method in methods]
    counts = {data_set: sum(pair.data_set == data_set for pair in right)
              for data_set in sorted({pair.data_set for pair in right})}
    text = (f'{report.ablation_table(rows, names)}\n\n{ablations.paper_table(rows)}\n\n'
            f'{len(right)} pairs ('
            + ', '.join(f'{count} {name}' for name, count in counts.items())
            + f'); the paper: 555 of KITTI, 9.5 m apart. {report.RULE}')
    _finish(arguments, text, [asdict(row) for row in rows], len(right), 0)
    plots.plot_ablation(arguments.output / 'plot.png', rows, names)
    return 0


def sequence(arguments: Namespace) -> int:
    """Compare odometries on drives, and what the tracker says of itself with the truth."""
    config = _config(arguments)
    drives = [drive for drive in _data_drives(arguments) if drive.T_world_sensor is not None
              and drive.heights_known and len(drive.frames) > 1]
    drives = [Drive(drive.name, drive.frames[:arguments.scans], drive.T_world_sensor)
              for drive in drives if arguments.scans > 1]
    if _wants_world(arguments) and arguments.scans > 1:
        drives.append(_world(arguments.seed, arguments.scans, arguments.speed))
    kinds = (scene_kinds(arguments.kinds or ())
             if _wants_world(arguments) and arguments.per_kind > 1 else {})
    if not drives and not kinds:
        raise InputError(f'{arguments.data or "world"}: no drive with two scans and poses.txt, '
                         'good in z')
    makers = sequences.odometries(config, _say, unlabelled=arguments.no_labels)
    tracks = [track for drive in drives for track in sequences.run_drive(drive, makers, config)]
    makers = sequences.trackers(config, unlabelled=arguments.no_labels)
    for number, kind in enumerate(kinds, 1):
        _say(f'{kind}, {number} of {len(kinds)} kinds: scanning')
        drive = scene_drive(kind, arguments.per_kind, arguments.seed)
        tracks += sequences.run_drive(drive, makers, config)
    text = '\n\n'.join((report.sequence_table(tracks), honesty_table(tracks), RULE))
    _finish(arguments, text, report.scan_records(tracks), 0, 0)
    plots.plot_sequences(arguments.output / 'plot.png', tracks)
    return 0


def solve(arguments: Namespace) -> int:
    """Time the solver on made-up matches and on those of the FPFH of real scans."""
    sets = [solver.made_up(count, arguments.inlier_share, arguments.seed)
            for count in arguments.counts]
    small = [matches for matches in sets if len(matches.source) <= arguments.dense_limit]
    if arguments.data or arguments.world:
        pairs = _right_pairs(arguments, _drives(arguments), arguments.pairs)
        sets += solver.fpfh_matches(pairs, arguments.fpfh_matches)
    if arguments.data:
        sets += solver.real_matches(arguments.data)
    rows = solver.run_solver(sets, _config(arguments), arguments.runs,
                             rivals=running.installed('kiss_matcher', _say))
    dense = _dense_reference()
    if dense is None:
        _say('no dense reference here: it is part of the tests, which are not installed')
    elif small:
        rows += solver.run_dense(small, dense)
    _finish(arguments, report.solver_table(rows), [asdict(row) for row in rows], 0, 0)
    plots.plot_solver(arguments.output / 'plot.png', rows)
    return 0


COMMANDS = {'pairs': pairs, 'wrong': wrong, 'ablation': ablation, 'sequence': sequence,
            'solver': solve}


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
    return open_drives(arguments.data) if arguments.data else []


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
        raise InputError(f'{arguments.data or "world"}: no pairs within '
                         f'{arguments.max_distance:g} m; they need poses.txt or pairs.json')
    return pairing.choose(candidates, count, arguments.seed)


def _right_and_wrong(arguments: Namespace) -> list[Pair]:
    drives = _drives(arguments)
    right = _right_pairs(arguments, drives, arguments.limit) if arguments.limit else []
    strangers = pairing.wrong_pairs(drives, arguments.count, arguments.seed)
    if arguments.count and not strangers:
        raise InputError('no wrong pairs: they need two drives, or one longer than '
                         f'{pairing.NO_OVERLAP_M:g} m; add --world')
    return right + strangers


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


def _finish(arguments: Namespace, text: str, records: list[dict[str, Any]], right: int,
            wrong: int) -> None:
    print(text)
    report.save(arguments.output, text, records, {
        'options': vars(arguments), 'right_pairs': right, 'wrong_pairs': wrong,
        'config': asdict(_config(arguments))})
    _say(f'wrote {arguments.output}')


def _say(text: str) -> None:
    print(text, file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
