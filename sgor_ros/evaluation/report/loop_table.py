"""The table of loops: a line for each drive."""
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..loops import LoopRun
from ..loops import OtherRun
from ..loops import WRONG_DEG
from ..loops import WRONG_M
from ..metrics.pose_error import NEES_95
from .tables import markdown

RULE = ('Revisits: keyframes within 20 m of one that was passed much earlier, and those of them '
        f'from which a right loop was closed. Wrong: loops off by over {WRONG_M:g} m or '
        f'{WRONG_DEG:g} deg. Errors: median. NEES of loops and of odometry edges between '
        'keyframes: mean, median, 6 and 5.3 where the covariance is right, and the share up to '
        f'{NEES_95:.1f} (95 %). APE: root of the mean square, from the first scan on, by odometry '
        'and with loops; where tracks stay apart, of the first. Chi-squared: of the whole graph, '
        'per degree of freedom.')
OTHERS_RULE = ('Others: revisits whose scan lies in a local map that closed a right loop; '
               'loops are those between local maps, judged alike. CPU: odometry included.')


def loop_table(runs: Sequence[LoopRun]) -> str:
    """Return the table."""
    return markdown(
        ['drive', 'scans', 'nodes', 'keyframes', 'MB', 'revisits closed', 'loops', 'wrong',
         'error [m]', '[deg]', 'NEES', 'NEES of odometry', 'APE before, after [m]', 'chi-squared',
         'CPU [ms] a scan'], [_line(run) for run in runs])


def others_table(runs: Sequence[LoopRun], others: Sequence[OtherRun]) -> str:
    """Return the table of other methods beside the mapper, drive by drive."""
    return markdown(
        ['drive', 'method', 'revisits closed', 'loops', 'wrong', 'error [m]', '[deg]',
         'CPU [ms] a scan'],
        [line for run in runs
         for line in ([run.drive, 'SGOR', *_judged(run)],
                      *([one.drive, one.method, *_judged(one)] for one in others
                        if one.drive == run.drive))])


def loop_records(runs: Sequence[LoopRun]) -> list[dict[str, Any]]:
    """Return a row for each loop and for each odometry edge."""
    loops = [{'drive': run.drive, 'kind': 'loop', 'source_stamp_ns': loop.source_stamp_ns,
              'target_stamp_ns': loop.target_stamp_ns, 'error_m': metres, 'error_deg': degrees,
              'nees': nees}
             for run in runs
             for loop, metres, degrees, nees in zip(run.loops, run.error_m.tolist(),
                                                    run.error_deg.tolist(), run.nees.tolist(),
                                                    strict=True)]
    return loops + [{'drive': run.drive, 'kind': 'odometry', 'nees': nees}
                    for run in runs for nees in run.odometry_nees.tolist()]


def _line(run: LoopRun) -> list[str]:
    scans = str(run.scans) if run.with_pose == run.scans else f'{run.with_pose} of {run.scans}'
    *judged, cpu = _judged(run)
    return [run.drive, scans, str(run.nodes), str(run.keyframes), f'{run.megabytes:.1f}',
            *judged, _nees(run.nees), _nees(run.odometry_nees),
            f'{run.ape_before_m:.3f}, {run.ape_after_m:.3f}',
            f'{run.chi_squared / run.freedom:.2f}' if run.freedom else '-', cpu]


def _judged(run: LoopRun | OtherRun) -> list[str]:
    """Return what all methods have: from the revisits closed to the time of a scan."""
    has = len(run.error_m) > 0
    return [f'{run.closed} of {run.revisits}', str(len(run.error_m)), str(run.wrong),
            f'{np.median(run.error_m):.3f}' if has else '-',
            f'{np.median(run.error_deg):.3f}' if has else '-',
            f'{1e3 * run.cpu_seconds / run.scans:.0f}']


def _nees(nees: NDArray[np.float64]) -> str:
    if not len(nees):
        return '-'
    return f'{nees.mean():.1f}, {np.median(nees):.1f}, {np.mean(nees <= NEES_95):.0%}'
