"""`sgor_benchmark solver`: the solver alone, on made-up matches and on those of scans."""
from argparse import ArgumentParser
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from ...core.common.settings import InputError
from ...evaluation import solver
from ...evaluation.methods import available
from ...evaluation.methods import ON_MATCHES
from ...evaluation.protocols.pairs import Pair
from ...evaluation.report import plots
from ...evaluation.report.tables import solver_table
from . import inputs
from .numbers import count
from .numbers import positive
from .numbers import share

HELP = 'time of the solver on made-up matches, and on those of the FPFH of your scans'
OTHER = "KISS-Matcher's solver"
"""Besides SGOR's, the one that is quick enough for so many matches."""


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--counts', type=positive, nargs='+',
                         default=[1000, 2000, 4000, 8000, 16000, 30000], help='of made-up matches')
    command.add_argument('--pairs', type=positive, default=8, help='of scans whose FPFH is '
                         'matched, with --data or --world')
    command.add_argument('--fpfh-matches', type=positive, default=8000, metavar='COUNT',
                         help='most of a pair')
    inputs.add_max_distance(command)
    command.add_argument('--inlier-share', type=share, default=0.02, help='of made-up matches')
    command.add_argument('--runs', type=positive, default=20, help='for each time')
    command.add_argument('--dense-limit', type=count, default=2000,
                         help='most matches for the dense reference')


def measure(arguments: Namespace, folder: Path) -> None:
    """Time the solver on made-up matches, and on those of the FPFH of scans."""
    made_up = [solver.made_up(count, arguments.inlier_share, arguments.seed)
               for count in arguments.counts]
    others = available({OTHER: ON_MATCHES[OTHER]}, inputs.say)
    rows = solver.run_solver([*made_up, *_of_scans(arguments)], inputs.default_config(arguments),
                             arguments.runs, list(others.values()))
    small = [pair for count, pair in zip(arguments.counts, made_up, strict=True)
             if count <= arguments.dense_limit]
    if small:
        rows += solver.run_dense(small)
    inputs.finish(arguments, folder, solver_table(rows), [asdict(row) for row in rows])
    plots.plot_solver(folder / 'plot.png', rows)


def _of_scans(arguments: Namespace) -> list[Pair]:
    """Return the matches in the folder of the user, and those of pairs of scans."""
    if not arguments.data and not arguments.world:
        return []
    given = list(solver.real_matches(arguments.data)) if arguments.data else []
    try:
        pairs = inputs.right_pairs(arguments, inputs.drives_of(arguments), arguments.pairs)
    except InputError:
        if not given:
            raise
        return given
    return [*solver.fpfh_matches(pairs, arguments.fpfh_matches), *given]
