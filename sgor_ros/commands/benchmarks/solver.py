"""`sgor_benchmark solver`: the solver alone, on made-up matches and on those of scans."""
from argparse import ArgumentParser
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from ...core.common.settings import InputError
from ...evaluation import runner
from ...evaluation.methods import rivals_on_matches
from ...evaluation.pairs.pair import Pair
from ...evaluation.protocols import solver
from ...evaluation.report import plots
from ...evaluation.report.solver_table import solver_table
from ...evaluation.report.solver_table import solver_times
from . import inputs
from .numbers import count
from .numbers import positive
from .numbers import share

HELP = 'time of the solver on made-up matches, and on those of the FPFH of your scans'
KISS_MATCHER = "KISS-Matcher's solver"


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
    config = inputs.default_config(arguments)
    sets = [solver.made_up(count, arguments.inlier_share, arguments.seed)
            for count in arguments.counts]
    small = [pair for count, pair in zip(arguments.counts, sets, strict=True)
             if count <= arguments.dense_limit]
    sets += _of_scans(arguments)
    methods = solver.presets(config)
    rivals = rivals_on_matches(inputs.say)
    if KISS_MATCHER in rivals:
        methods.append(rivals[KISS_MATCHER])
    # the first round only warms up, unless it is the only one
    repeats = arguments.runs + 1 if arguments.runs > 1 else 1
    rows = runner.run(solver.solver_protocol(sets), methods, repeats=repeats)
    times = list(solver_times(rows, sets, arguments.runs, config))
    if small:
        rows = runner.run(solver.solver_protocol(small), solver.dense_and_sparse())
        times += solver_times(rows, small, 1, solver.DENSE_CONFIG)
    inputs.finish(arguments, folder, solver_table(times), [asdict(each) for each in times])
    plots.plot_solver(folder / 'plot.png', times)


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
