"""The picture of a registration; matplotlib is loaded when it is drawn."""
from collections.abc import Sequence
from pathlib import Path
import textwrap
from typing import Any
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..core.scan.ground import Ground
from ..core.scan.scan import SemanticScan
from ..core.verdict.result import Registration
from .colours import INLIER
from .colours import REJECTED
from .colours import SOURCE
from .colours import TARGET
from .writing import new_file

PICTURES = ('.png', '.pdf', '.svg')

Array = NDArray[np.float64]

# what the eye still tells apart in a picture of this size
SHOWN_POINTS = 40000
SHOWN_REJECTED = 250
SHOWN_INLIERS = 400
# letters over one of two panels
CAPTION_WIDTH = 75
# about as high as a kerb: only for the picture
GROUND_BAND_M = 0.3
# this share of the points is inside the picture of a scan
SHOWN_SHARE = 0.97


def plot_registration(path: str | Path, title: str, source: SemanticScan, target: SemanticScan,
                      result: Registration) -> None:
    """Draw both clouds from above before and after, and the correspondences between them.

    Parameters
    ----------
    path : str or Path
        Picture to write; its ending is one of `PICTURES`.
    title : str
    source, target : SemanticScan
    result : Registration
        Of `source` to `target`; without a transformation the clouds are drawn as they came.
    """
    figure = new_figure(13, 6.8, 'compressed')
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.suptitle(title, x=0.02, ha='left', weight='bold')
    T = np.eye(4) if result.T_target_source is None else result.T_target_source
    moved = se3.transform(T, source.points.astype(np.float64))
    low = [_on_ground(scan.points, plane)
           for scan, plane in ((source, result.source_ground), (target, result.target_ground))]
    for axes, points in ((left, source.points), (right, moved)):
        _draw_cloud(axes, target.points, low[1], TARGET, 'target')
        _draw_cloud(axes, points, low[0], SOURCE, 'source')
    _draw_matches(left, result.source_points, result.target_points, result.inliers)
    for axes, placed in ((left, np.eye(4)), (right, T)):
        for pose, colour in ((np.eye(4), TARGET), (placed, SOURCE)):
            axes.plot(*pose[:2, 3], 'o', ms=8, mfc='white', mec=colour, mew=2.5, zorder=5)
    left.plot([], [], 'o', ms=8, mfc='white', mec='black', mew=1.5, label='sensor')
    _caption(left, 'as they came')
    _caption(right, 'aligned' if result.success else f'not registered: {result.reason}; '
             f'{"as they came" if result.T_target_source is None else "best candidate"}')
    _frame_clouds((left, right), np.vstack((source.points, target.points, moved))[:, :2])
    for axes in (left, right):
        axes.set(aspect='equal', xlabel='x [m]', ylabel='y [m]')
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside lower center', ncols=6, frameon=False)
    save(figure, path)


def new_figure(width: float, height: float,
               layout: Literal['constrained', 'compressed'] = 'constrained') -> Any:
    """Return an empty figure that needs no screen; its sides are in inches."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f'pictures need matplotlib: {error}') from error
    return Figure(figsize=(width, height), layout=layout)


def save(figure: Any, path: str | Path) -> None:
    """Give the axes of a figure their looks and write it."""
    for axes in figure.axes:
        axes.grid(True, color='#e3e6ea', lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[['top', 'right']].set_visible(False)
        axes.title.set_fontsize(10)
    with new_file(path) as place:
        figure.savefig(place, dpi=130, bbox_inches='tight', pad_inches=0.15)


def _on_ground(points: NDArray[Any], ground: Ground | None) -> NDArray[np.bool_]:
    if ground is None:
        return np.zeros(len(points), np.bool_)
    return np.abs(ground.heights(points)) < GROUND_BAND_M


def _draw_cloud(axes: Any, points: NDArray[Any], low: NDArray[np.bool_], colour: str, label: str
                ) -> None:
    """Draw what stands stronger than what lies: the ground looks the same everywhere."""
    for part, alpha, size in ((points[low], 0.25, 0.3), (points[~low], 0.7, 0.8)):
        shown = part[::max(1, len(part) // SHOWN_POINTS)]
        axes.scatter(shown[:, 0], shown[:, 1], s=size, color=colour, alpha=alpha, linewidths=0,
                     rasterized=True)
    axes.plot([], [], 's', color=colour, ms=7, label=label)


def _draw_matches(axes: Any, source: Array, target: Array, inliers: NDArray[np.bool_]) -> None:
    """Draw the matches as lines, no more than the eye takes in, and tell how many there are."""
    from matplotlib.collections import LineCollection
    ends = np.stack((source[:, :2], target[:, :2]), axis=1)
    for name, part, limit, colour, width, alpha in (
            ('rejected', ends[~inliers], SHOWN_REJECTED, REJECTED, 0.5, 0.3),
            ('inliers', ends[inliers], SHOWN_INLIERS, INLIER, 0.9, 0.8)):
        step = -(-len(part) // limit) or 1
        axes.add_collection(LineCollection(list(part[::step]), colors=colour, linewidths=width,
                                           alpha=alpha))
        shown = f', one in {step} drawn' if step > 1 else ''
        axes.plot([], [], '-', color=colour, lw=2, label=f'{name} ({len(part)}{shown})')


def _caption(axes: Any, text: str) -> None:
    """Set a title that stays over its own panel."""
    axes.set_title(textwrap.fill(text, CAPTION_WIDTH), loc='left')


def _frame_clouds(panels: Sequence[Any], xy: NDArray[Any]) -> None:
    """Show where nearly all points are: a few far returns would make the picture tiny."""
    cut = (1 - SHOWN_SHARE) / 2
    low, high = np.quantile(xy, (cut, 1 - cut), axis=0)
    margin = 0.06 * (high - low).max()
    for axes in panels:
        axes.set(xlim=(low[0] - margin, high[0] + margin),
                 ylim=(low[1] - margin, high[1] + margin))
