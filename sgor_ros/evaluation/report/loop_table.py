"""The table of loops: a line for each drive."""
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..loops import LoopRun
from ..loops import WRONG_DEG
from ..loops import WRONG_M
from ..metrics.pose_error import NEES_BOUND
from .tables import markdown

RULE = ('Revisits: keyframes within 20 m of one that was passed much earlier, and those of them '
        f'from which a loop was closed. Wrong: loops off by over {WRONG_M:g} m or {WRONG_DEG:g} '
        'deg. Errors: median. NEES: mean, 6 where the covariance is right, and the share up to '
        f'{NEES_BOUND:.1f} (99.73 %). APE: root of the mean square, from the first scan on, by '
        'odometry and with loops; where tracks stay apart, of the first. Chi-squared: of the '
        'whole graph, per degree of freedom.')


def loop_table(runs: Sequence[LoopRun]) -> str:
    """Return the table."""
    return markdown(
        ['drive', 'scans', 'nodes', 'keyframes', 'MB', 'revisits closed', 'loops', 'wrong',
         'error [m]', '[deg]', 'NEES', 'APE before, after [m]', 'chi-squared', 'CPU [ms] a scan'],
        [_line(run) for run in runs])


def loop_records(runs: Sequence[LoopRun]) -> list[dict[str, Any]]:
    """Return a row for each loop."""
    return [{'drive': run.drive, 'error_m': metres, 'error_deg': degrees, 'nees': nees}
            for run in runs
            for metres, degrees, nees in zip(run.error_m.tolist(), run.error_deg.tolist(),
                                             run.nees.tolist(), strict=True)]


def _line(run: LoopRun) -> list[str]:
    scans = str(run.scans) if run.with_pose == run.scans else f'{run.with_pose} of {run.scans}'
    has = len(run.error_m) > 0
    return [run.drive, scans, str(run.nodes), str(run.keyframes), f'{run.megabytes:.1f}',
            f'{run.closed} of {run.revisits}', str(len(run.error_m)), str(run.wrong),
            f'{np.median(run.error_m):.3f}' if has else '-',
            f'{np.median(run.error_deg):.3f}' if has else '-',
            f'{run.nees.mean():.1f}, {np.mean(run.nees <= NEES_BOUND):.0%}' if has else '-',
            f'{run.ape_before_m:.3f}, {run.ape_after_m:.3f}',
            f'{run.chi_squared / run.freedom:.2f}' if run.freedom else '-',
            f'{1e3 * run.cpu_seconds / run.scans:.0f}']
