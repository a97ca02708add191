"""`sgor_benchmark pairs`: methods on the same pairs."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

from ...core.common.settings import InputError
from ...evaluation import runner
from ...evaluation.methods import Method
from ...evaluation.methods import rivals_on_scans
from ...evaluation.methods.sgor import on_scans
from ...evaluation.pairs import selection
from ...evaluation.pairs.front_end import scans_of
from ...evaluation.protocols.protocol import Protocol
from ...evaluation.report import pair_tables
from ...evaluation.report import plots
from ...evaluation.rows import records
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
    wrong = selection.different_places(drives, arguments.wrong, arguments.seed)
    rows = runner.run(Protocol.turned(right, arguments.seed), methods, warm_up=True)
    refusing = [method for method in methods if method.refuses]
    if wrong and refusing:
        rows += runner.run(Protocol.turned(wrong, arguments.seed), refusing, warm_up=True)
    memory = runner.peak_memory_mb(methods, scans_of(right[0], arguments.seed)[0])
    names = [method.name for method in methods]
    text = '\n\n'.join((
        pair_tables.pairs_table(rows, names, memory), pair_tables.data_sets_table(rows, names),
        pair_tables.RULE + ' Peak memory: of a process of its own for each method, its libraries '
        f'included; {memory[""]:.0f} MB of it are Python with numpy, scipy, numba and the two '
        'scans.'))
    inputs.finish(arguments, folder, text, records(rows), len(right), len(wrong))
    plots.plot_pairs(folder / 'plot.png', rows, names)


def _methods(arguments: Namespace) -> list[Method]:
    config = inputs.default_config(arguments)
    known = {'sgor': on_scans('SGOR', config),
             'paper': on_scans("SGOR, paper's settings", inputs.paper_config(arguments)),
             **rivals_on_scans(inputs.say)}
    for name in arguments.methods or ():
        if name not in known:
            raise InputError(f'--methods {name}: not one of {", ".join(known)}')
    chosen = [known[name] for name in arguments.methods or known]
    if arguments.label_noise:
        chosen.append(on_scans(f'SGOR, {arguments.label_noise:.0%} of labels random', config,
                           arguments.label_noise))
    if arguments.no_labels:
        chosen.append(on_scans('SGOR, no labels', config, labels=False))
    return chosen
