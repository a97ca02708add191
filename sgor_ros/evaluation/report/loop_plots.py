"""The picture of a map: odometry before, the trajectory after, and the loops in between."""
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...io.colours import ESTIMATE
from ...io.colours import INLIER
from ...io.colours import LIMIT
from ...io.plots import new_figure
from ...io.plots import save

Array = NDArray[np.float64]


def plot_loops(path: Path, title: str, before: Array, after: Array,
               loops: Sequence[tuple[int, int]], cloud: NDArray[np.float32]) -> None:
    """Draw trajectories from above.

    Parameters
    ----------
    path : Path
        PNG to write.
    title : str
    before, after : (N, 4, 4) array
        Poses by odometry alone and with loops, metres.
    loops : sequence of (int, int)
        Which two poses each loop joins.
    cloud : (P, 3) array
        Of the map, metres.
    """
    figure = new_figure(13, 6.8, 'compressed')
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.suptitle(title, x=0.02, ha='left', weight='bold')
    left.plot(*before[:, :2, 3].T, '-', color=ESTIMATE, lw=1.5)
    left.set_title('before: odometry', loc='left')
    right.scatter(*cloud[:, :2].T, s=0.3, c=LIMIT, linewidths=0)
    right.plot(*after[:, :2, 3].T, '-', color=ESTIMATE, lw=1.5)
    for loop in loops:
        right.plot(*after[list(loop), :2, 3].T, '-', color=INLIER, lw=1.5)
    right.set_title(f'after: {len(loops)} loops closed', loc='left')
    for axes in (left, right):
        axes.set(xlabel='x [m]', ylabel='y [m]', aspect='equal')
    save(figure, path)
