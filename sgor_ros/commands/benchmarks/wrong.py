"""`sgor_benchmark wrong`: what is claimed and wrong, and what is known not to be known."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

import numpy as np

from ...core.common.settings import InputError
from ...evaluation.methods import sgor
from ...evaluation.metrics.row import Row
from ...evaluation.metrics.row import scan_records
from ...evaluation.protocols import pairs as pairing
from ...evaluation.protocols.pairs import Pair
from ...evaluation.report import outcomes
from ...evaluation.report import plots
from ...evaluation.report.reliability_diagram import plot_reliability_diagram
from ...evaluation.report.tables import confidence_table
from ...evaluation.runner import run_pairs
from ..scene_pairs import scene_kinds
from ..scene_pairs import scene_pairs
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
    methods = [sgor('SGOR', config), sgor('SGOR, no labels', config, labels=False)]
    names = [method.name for method in methods]
    kinds = (scene_kinds(arguments.kinds or ())
             if inputs.wants_world(arguments) and arguments.per_kind else {})
    rows: list[Row] = []
    so_far: list[Row] = []
    texts = []
    if arguments.limit or arguments.count:
        with inputs.kept_if_stopped(arguments, folder, so_far):
            rows = run_pairs(_right_and_wrong(arguments), methods, arguments.seed, so_far)
        labelled = [row for row in rows if row.method == names[0]]
        thresholds = sorted({*np.arange(0.4, 1.0, 0.05).round(2), config.min_confidence})
        texts.append(confidence_table(labelled, thresholds, config.min_confidence)
                     + f'\n\n{sum(row.right for row in labelled)} right and '
                     f'{sum(not row.right for row in labelled)} wrong pairs. Answers that the '
                     'default threshold refused keep the confidence that they were refused with.')
    elif not kinds:
        raise InputError('--limit 0 --count 0: nothing is left to do without --per-kind')
    with inputs.kept_if_stopped(arguments, folder, so_far):
        for number, kind in enumerate(kinds, 1):
            inputs.say(f'{kind}, {number} of {len(kinds)} kinds: scanning')
            rows += run_pairs(scene_pairs(kind, arguments.per_kind, arguments.seed), methods,
                              arguments.seed, so_far)
    repeating = [kind for kind, repeats in kinds.items() if repeats]
    texts += [outcomes.outcome_table(rows, names, repeating), outcomes.RULE,
              outcomes.wrong_claims(rows, names), outcomes.reliability_table(rows, names)]
    right = sum(row.right for row in rows) // len(methods)
    inputs.finish(arguments, folder, '\n\n'.join(texts), scan_records(rows), right,
                  len(rows) // len(methods) - right)
    if arguments.limit or arguments.count:
        plots.plot_confidence(folder / 'confidence.png', labelled, config.min_confidence)
    plot_reliability_diagram(folder / 'reliability.png', rows, names, config.min_confidence)


def _right_and_wrong(arguments: Namespace) -> list[Pair]:
    drives = inputs.drives_of(arguments)
    right = inputs.right_pairs(arguments, drives, arguments.limit) if arguments.limit else []
    different = pairing.wrong_pairs(drives, arguments.count, arguments.seed)
    if arguments.count and not different:
        raise InputError('no wrong pairs: they need two drives, or one longer than '
                         f'{pairing.NO_OVERLAP_M:g} m; add --world')
    return right + different
