"""`sgor_benchmark pairs`: methods on the same pairs."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

from ...core.common.settings import InputError
from ...evaluation.job import turned
from ...evaluation.memory import peak_memory_mb
from ...evaluation.methods import available
from ...evaluation.methods import Method
from ...evaluation.methods import ON_SCANS
from ...evaluation.methods import sgor
from ...evaluation.metrics.row import Row
from ...evaluation.metrics.row import scan_records
from ...evaluation.protocols import pairs as pairing
from ...evaluation.report import plots
from ...evaluation.report import tables
from ...evaluation.runner import run_pairs
from . import inputs
from .numbers import count
from .numbers import positive
from .numbers import share

HELP = 'registration of pairs: recall, errors, time, memory, false accepts'


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--methods', nargs='+', metavar='NAME', help='of sgor, paper, '
                         'kiss-matcher-0.3, kiss-matcher-0.5, ransac, fgr; default: all installed')
    command.add_argument('--label-noise', type=share, metavar='SHARE',
                         help='also run SGOR with this share of all labels random')
    command.add_argument('--no-labels', action='store_true', help='also run SGOR without labels')
    command.add_argument('--wrong', type=count, default=50, help='pairs of different places, to '
                         'see what is accepted of them')
    command.add_argument('--limit', type=positive, default=300, help='right pairs, chosen at '
                         'random and evenly over data sets and distances')
    inputs.add_max_distance(command)


def measure(arguments: Namespace, folder: Path) -> None:
    """Compare methods on pairs."""
    methods = _methods(arguments)
    drives = inputs.drives_of(arguments)
    right = inputs.right_pairs(arguments, drives, arguments.limit)
    wrong = pairing.wrong_pairs(drives, arguments.wrong, arguments.seed)
    refusing = [method for method in methods if method.refuses]
    so_far: list[Row] = []
    with inputs.kept_if_stopped(arguments, folder, so_far):
        rows = run_pairs(right, methods, arguments.seed, so_far)
        if wrong and refusing:
            rows += run_pairs(wrong, refusing, arguments.seed, so_far)
        memory = peak_memory_mb(methods, turned(right[0], arguments.seed)[0])
    names = [method.name for method in methods]
    text = '\n\n'.join((
        tables.pairs_table(rows, names, memory), tables.data_sets_table(rows, names), tables.RULE
        + ' Peak memory: of a process of its own for each method, its libraries included; '
        f'{memory[""]:.0f} MB of it are Python with numpy, scipy, numba and the two scans.'))
    inputs.finish(arguments, folder, text, scan_records(rows), len(right), len(wrong))
    plots.plot_pairs(folder / 'plot.png', rows, names)


def _methods(arguments: Namespace) -> list[Method]:
    config = inputs.default_config(arguments)
    known = {'sgor': sgor('SGOR', config),
             'paper': sgor("SGOR, paper's settings", inputs.paper_config(arguments)),
             **available(ON_SCANS, inputs.say)}
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
