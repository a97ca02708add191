"""`sgor_benchmark wrong`: what is claimed and wrong, and what is known not to be known."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

import numpy as np

from ...core.common.settings import InputError
from ...evaluation import runner
from ...evaluation.methods.sgor import on_scans
from ...evaluation.pairs import selection
from ...evaluation.pairs.pair import Pair
from ...evaluation.protocols.protocol import Protocol
from ...evaluation.protocols.scenes import scene_kinds
from ...evaluation.protocols.scenes import scene_pairs
from ...evaluation.report import consistency_tables
from ...evaluation.report import pair_tables
from ...evaluation.report import plots
from ...evaluation.rows import records
from . import inputs
from .numbers import count

HELP = ('what is claimed and wrong: confidence of right and wrong pairs, and what becomes of '
        'places that repeat themselves')


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--count', type=count, default=500, help='wrong pairs')
    command.add_argument('--per-kind', type=count, default=10, metavar='COUNT', help='pairs of '
                         'the same place, and of different places, of each kind in the built-in '
                         'world: tunnels, corridors, facades and others that repeat themselves')
    command.add_argument('--limit', type=count, default=300, help='right pairs, chosen at '
                         'random and evenly over data sets and distances')
    inputs.add_max_distance(command)
    inputs.add_kinds(command)


def measure(arguments: Namespace, folder: Path) -> None:
    """Show how far confidence tells right from wrong, and what is known not to be known."""
    config = inputs.default_config(arguments)
    methods = [on_scans('SGOR', config), on_scans('SGOR, no labels', config, labels=False)]
    names = [method.name for method in methods]
    kinds = (scene_kinds(arguments.kinds or ())
             if inputs.wants_world(arguments) and arguments.per_kind else {})
    rows, texts = [], []
    if arguments.limit or arguments.count:
        rows = runner.run(Protocol.turned(_right_and_wrong(arguments), arguments.seed), methods,
                          warm_up=True)
        labelled = [row for row in rows if row.method == names[0]]
        thresholds = sorted({*np.arange(0.4, 1.0, 0.05).round(2), config.min_confidence})
        texts.append(pair_tables.confidence_table(labelled, thresholds, config.min_confidence)
                     + f'\n\n{sum(row.same_place for row in labelled)} right and '
                     f'{sum(not row.same_place for row in labelled)} wrong pairs. Answers that '
                     'the default threshold refused keep the confidence that they were refused '
                     'with.')
    elif not kinds:
        raise InputError('--limit 0 --count 0: nothing is left to do without --per-kind')
    for number, kind in enumerate(kinds, 1):
        inputs.say(f'{kind}, {number} of {len(kinds)} kinds: scanning')
        rows += runner.run(Protocol.turned(
            scene_pairs(kind, arguments.per_kind, arguments.seed), arguments.seed), methods,
            warm_up=True)
    repeating = [kind for kind, repeats in kinds.items() if repeats]
    texts += [consistency_tables.trust_table(rows, names, repeating), consistency_tables.RULE,
              consistency_tables.wrong_claims(rows, names),
              consistency_tables.reliability_table(rows, names)]
    right = sum(row.same_place for row in rows) // len(methods)
    inputs.finish(arguments, folder, '\n\n'.join(texts), records(rows), right,
                  len(rows) // len(methods) - right)
    if arguments.limit or arguments.count:
        plots.plot_confidence(folder / 'confidence.png', labelled, config.min_confidence)
    plots.plot_reliability(folder / 'reliability.png', rows, names, config.min_confidence)


def _right_and_wrong(arguments: Namespace) -> list[Pair]:
    drives = inputs.drives_of(arguments)
    right = inputs.right_pairs(arguments, drives, arguments.limit) if arguments.limit else []
    different = selection.different_places(drives, arguments.count, arguments.seed)
    if arguments.count and not different:
        raise InputError('no wrong pairs: they need two drives, or one longer than '
                         f'{selection.NO_OVERLAP_M:g} m; add --world')
    return right + different
