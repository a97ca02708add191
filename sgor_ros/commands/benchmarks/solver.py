"""`sgor_benchmark solver`: the solver alone, on made-up matches and on those of scans."""
from argparse import ArgumentParser
from argparse import Namespace
from dataclasses import asdict
import importlib.util
from pathlib import Path

from ...core.common.settings import InputError
from ...evaluation import plots
from ...evaluation import report
from ...evaluation import run as running
from ...evaluation import solver
from . import inputs
from .numbers import count
from .numbers import positive
from .numbers import share

HELP = 'time of the solver on made-up matches, and on those of the FPFH of your scans'
DENSE_REFERENCE = Path(__file__).parents[3] / 'test/dense_reference.py'


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
    sets = [solver.made_up(count, arguments.inlier_share, arguments.seed)
            for count in arguments.counts]
    small = [matches for matches in sets if len(matches.source) <= arguments.dense_limit]
    rows = solver.run_solver([*sets, *_of_scans(arguments)], inputs.default_config(arguments),
                             arguments.runs, rivals=running.installed('kiss_matcher', inputs.say))
    dense = _dense_reference()
    if dense is None:
        inputs.say('no dense reference here: it is part of the tests, which are not installed')
    elif small:
        rows += solver.run_dense(small, dense)
    inputs.finish(arguments, folder, report.solver_table(rows), [asdict(row) for row in rows])
    plots.plot_solver(folder / 'plot.png', rows)


def _of_scans(arguments: Namespace) -> list[solver.Matches]:
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
