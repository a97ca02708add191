"""`sgor_benchmark ablation`: every mechanism off, one at a time."""
from argparse import ArgumentParser
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...core.config import SgorConfig
from ...evaluation import plots
from ...evaluation import report
from ...evaluation import run as running
from ...evaluation.run import sgor
from . import inputs
from .numbers import positive

HELP = 'every mechanism off, one at a time'

# what is beyond the paper, turned off
WITHOUT: tuple[dict[str, Any], ...] = (
    {'match_within_labels': False}, {'height_gate': 0.0}, {'context_weight': 0.0},
    {'cloud_check': False}, {'robust_ground': False}, {'drop_ground_labels': False},
    {'quick_keypoints': 0}, {'local_refinement': False}, {'refinement_rounds': 1},
    {'moving_vote': True}, {'unlabelled_attempt': False}, {'rival_radius': 0.0},
    {'min_confidence': 0.0}, {'scale': 1.0},
    {'weight_cutoff': SgorConfig.paper().weight_cutoff})
# ablations 1, 3, 5, 6 and 8 of the paper
PAPER_WITHOUT: tuple[dict[str, Any], ...] = (
    {'correspondence_preprocessing': False}, {'secondary_ground': False}, {'semantics': 'none'},
    {'semantics': 'hard'}, {'ground_check': False})


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--pairs', type=positive, default=200, help='right pairs, chosen at '
                         'random and evenly over data sets and distances')
    inputs.add_max_distance(command)


def measure(arguments: Namespace, folder: Path) -> None:
    """Turn the mechanisms off, one at a time."""
    config = inputs.default_config(arguments)
    paper = inputs.paper_config(arguments)
    methods = [sgor('default', config),
               *(sgor(_name(change), config.replace(**change)) for change in WITHOUT),
               sgor('paper', paper),
               *(sgor(f'paper, {_name(change)}', paper.replace(**change))
                 for change in PAPER_WITHOUT)]
    right = inputs.right_pairs(arguments, inputs.drives_of(arguments), arguments.pairs)
    rows = running.run_pairs(right, methods, arguments.seed)
    names = [method.name for method in methods]
    counts = {data_set: sum(pair.data_set == data_set for pair in right)
              for data_set in sorted({pair.data_set for pair in right})}
    text = (report.ablation_table(rows, names) + f'\n\n{len(right)} pairs ('
            + ', '.join(f'{count} {name}' for name, count in counts.items())
            + f'). {report.RULE}')
    inputs.finish(arguments, folder, text, [asdict(row) for row in rows], len(right))
    plots.plot_ablation(folder / 'plot.png', rows, names)


def _name(change: dict[str, Any]) -> str:
    return ', '.join(f'{name}={value}' for name, value in change.items())
