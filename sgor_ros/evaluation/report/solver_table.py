"""Table of solvers: times and errors on each set of matches."""
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from ...core.config import SgorConfig
from ...core.matching.correspondences import given_correspondences
from ...core.solver.graph import consistency_graph
from ..pairs.pair import Pair
from ..rows import Row
from .cells import by_method
from .cells import markdown


@dataclass(frozen=True)
class SolverTimes:
    """Times of one solver on one set of matches; RE in degrees, TE in metres, NaN if it failed.

    Attributes
    ----------
    consistent_share : float
        Of all pairs of matches (M', Eq. 6).
    cpu_seconds : float
        Of all threads, the least of all runs: what other processes disturb least.
    """

    solver: str
    matches: str
    count: int
    inlier_share: float
    consistent_share: float
    seconds_median: float
    seconds_p95: float
    cpu_seconds: float
    runs: int
    rotation_error_deg: float
    translation_error_m: float


def solver_times(rows: Sequence[Row], pairs: Sequence[Pair], runs: int, config: SgorConfig
                 ) -> Iterator[SolverTimes]:
    """Sum up rows of a run in the order of pairs; of each solver on each pair the last `runs`."""
    per_pair = len(rows) // max(len(pairs), 1)
    for number, pair in enumerate(pairs):
        share = _consistent_share(pair, config)
        for solver, own in by_method(rows[number * per_pair:(number + 1) * per_pair]).items():
            last = own[-1]
            seconds = np.array([row.seconds for row in own[-runs:]])
            yield SolverTimes(
                solver, pair.name, last.matches, last.inlier_share, share,
                float(np.median(seconds)), float(np.percentile(seconds, 95)),
                min(row.cpu_seconds for row in own[-runs:]), runs, last.rotation_error_deg,
                last.translation_error_m)


def solver_table(times: Sequence[SolverTimes]) -> str:
    """Return times and errors of each solver on each set of matches."""
    return markdown(
        ['matches', 'count', 'right [%]', 'pairs consistent [%]', 'solver', 'time [ms]',
         'CPU [ms]', 'time / count^2 [ns]', 'runs', 'RE [deg]', 'TE [cm]'],
        [[each.matches, str(each.count), f'{100 * each.inlier_share:.2f}',
          f'{100 * each.consistent_share:.2f}', each.solver,
          f'{1e3 * each.seconds_median:.1f} / {1e3 * each.seconds_p95:.1f}',
          f'{1e3 * each.cpu_seconds:.1f}', f'{1e9 * each.seconds_median / each.count**2:.2f}',
          str(each.runs),
          *(('failed', 'failed') if math.isnan(each.rotation_error_deg) else
            (f'{each.rotation_error_deg:.3f}', f'{100 * each.translation_error_m:.1f}'))]
         for each in times])


def _consistent_share(pair: Pair, config: SgorConfig) -> float:
    assert pair.matches is not None
    given = given_correspondences(pair.matches.source, pair.matches.target, None, None, config)
    return len(consistency_graph(given, config).index) / len(given)**2
