"""`sgor_benchmark ablation`: every mechanism off, one at a time."""
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path

from ...evaluation.metrics.row import Row
from ...evaluation.metrics.row import scan_records
from ...evaluation.protocols import ablation as ablations
from ...evaluation.report import plots
from ...evaluation.report import tables
from ...evaluation.runner import run_pairs
from . import inputs
from .numbers import positive

HELP = 'every mechanism off, one at a time'


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--pairs', type=positive, default=200, help='right pairs, chosen at '
                         'random and evenly over data sets and distances')
    command.add_argument('--paper', action='store_true', help="only the rows of the paper's table "
                         'and its other readings')
    inputs.add_max_distance(command)


def measure(arguments: Namespace, folder: Path) -> None:
    """Turn the mechanisms off, one at a time, as the paper does and ours too."""
    methods = ablations.methods(arguments.cores, only_paper=arguments.paper)
    right = inputs.right_pairs(arguments, inputs.drives_of(arguments), arguments.pairs)
    so_far: list[Row] = []
    with inputs.kept_if_stopped(arguments, folder, so_far):
        rows = run_pairs(right, methods, arguments.seed, so_far)
    names = [method.name for method in methods]
    counts = {data_set: sum(pair.data_set == data_set for pair in right)
              for data_set in sorted({pair.data_set for pair in right})}
    text = (f'{tables.ablation_table(rows, names)}\n\n{tables.paper_table(rows)}\n\n'
            f'{len(right)} pairs ('
            + ', '.join(f'{count} {name}' for name, count in counts.items())
            + f'); the paper: 555 of KITTI, 9.5 m apart. {tables.RULE}')
    inputs.finish(arguments, folder, text, scan_records(rows), len(right))
    plots.plot_ablation(folder / 'plot.png', rows, names)
