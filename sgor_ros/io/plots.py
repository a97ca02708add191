"""Pictures of results; matplotlib is loaded when the first one is drawn."""
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..core import se3
from ..core.ground import Ground
from ..core.scan import Registration
from ..core.scan import SemanticScan
from ..core.settings import InputError

Array = NDArray[np.float64]

BLUE, ORANGE, GREEN, RED, GREY = '#2f6db3', '#e08a1e', '#2a9d5c', '#d1495b', '#8a8f98'
# what the eye still tells apart in a picture of this size
SHOWN_POINTS = 40000
SHOWN_REJECTED = 250
SHOWN_INLIERS = 400
# about as high as a kerb: only for the picture
GROUND_BAND_M = 0.3
# this share of the points is inside the picture of a scan
SHOWN_SHARE = 0.97


def plot_track(path: str | Path, title: str, stamps_s: Sequence[float],
               poses: Sequence[Array | None], seconds: Sequence[float],
               confidence: Sequence[float]) -> None:
    """Draw the trajectory from above, and time and confidence of each scan.

    Parameters
    ----------
    path : str or Path
        PNG to write.
    title : str
    stamps_s : sequence of float
        Of each scan, seconds.
    poses : sequence of (4, 4) array or None
        T_odom_sensor; None where the scan has none.
    seconds : sequence of float
        What each scan took; nan where it was not processed.
    confidence : sequence of float
        0 to 1; nan where nothing was registered.
    """
    figure = _figure((13, 6.2))
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
    ground, upper = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    lower = figure.add_subplot(grid[1, 1], sharex=upper)
    figure.suptitle(title, x=0.02, ha='left', weight='bold')
    _draw_track(ground, poses)
    time_s = np.asarray(stamps_s) - stamps_s[0]
    lost = np.array([T is None for T in poses])
    _draw_times(upper, time_s, np.asarray(seconds) * 1e3)
    lower.plot(time_s, confidence, '.-', color=GREEN, lw=1, ms=4)
    for t in time_s[lost]:
        lower.axvline(t, color=RED, lw=1)
    lower.set(ylim=(0, 1.05), ylabel='confidence', xlabel='time since the first scan [s]',
              title='no scan without a pose' if not lost.any()
              else f'{lost.sum()} scans without a pose (red)')
    _save(figure, path)


def plot_registration(path: str | Path, title: str, source: SemanticScan, target: SemanticScan,
                      result: Registration) -> None:
    """Draw both clouds from above before and after, and the correspondences between them.

    Parameters
    ----------
    path : str or Path
        PNG to write.
    title : str
    source, target : SemanticScan
    result : Registration
        Of `source` to `target`; without a transformation the clouds are drawn as they came.
    """
    figure = _figure((13, 6.8), 'compressed')
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.suptitle(title, x=0.02, ha='left', weight='bold')
    T = np.eye(4) if result.T_target_source is None else result.T_target_source
    moved = se3.transform(T, source.points.astype(np.float64))
    low = [_on_ground(scan.points, plane)
           for scan, plane in ((source, result.source_ground), (target, result.target_ground))]
    for axes, points in ((left, source.points), (right, moved)):
        _draw_cloud(axes, target.points, low[1], BLUE, 'target')
        _draw_cloud(axes, points, low[0], ORANGE, 'source')
    _draw_matches(left, result.source_points, result.target_points, result.inliers)
    for label, pose, colour in (('target', np.eye(4), BLUE), ('source', T, ORANGE)):
        right.plot(*pose[:2, 3], 'o', ms=8, mfc=colour, mec='white', mew=1.5, zorder=5,
                   label=f'{label} sensor')
    left.set_title(f'as they came; {int(result.inliers.sum())} inliers (green) of '
                   f'{len(result.inliers)} matches')
    right.set_title('aligned' if result.success else f'not registered: {result.reason}; '
                    f'{"as they came" if result.T_target_source is None else "best candidate"}')
    _frame_clouds((left, right), np.vstack((source.points, target.points, moved))[:, :2])
    for axes in (left, right):
        axes.set(aspect='equal', xlabel='x [m]', ylabel='y [m]')
        axes.legend(loc='upper right', markerscale=1.0, framealpha=0.9)
    _save(figure, path)


def _figure(size: tuple[float, float],
            layout: Literal['constrained', 'compressed'] = 'constrained') -> Any:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f'pictures need matplotlib: {error}') from error
    figure = Figure(figsize=size, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def _save(figure: Any, path: str | Path) -> None:
    for axes in figure.axes:
        axes.grid(True, color='#e3e6ea', lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[['top', 'right']].set_visible(False)
        axes.title.set_fontsize(10)
    figure.savefig(path, dpi=130, bbox_inches='tight', pad_inches=0.15)


def _draw_track(axes: Any, poses: Sequence[Array | None]) -> None:
    xy = np.array([T[:2, 3] for T in poses if T is not None])
    bridged = np.array([T is None for T in poses])
    axes.plot(*xy.T, '-', color=BLUE, lw=2)
    axes.plot(*xy.T, '.', color=BLUE, ms=5 if len(xy) < 300 else 0)
    known = np.flatnonzero(~bridged)
    for i in np.flatnonzero(np.diff(known) > 1):
        axes.plot(*xy[i:i + 2].T, '-', color=RED, lw=2.5)
    axes.plot(*xy[0], 'o', color=GREEN, ms=9, label='start')
    axes.plot(*xy[-1], 's', color=ORANGE, ms=8, label='end')
    length = np.linalg.norm(np.diff([T[:3, 3] for T in poses if T is not None], axis=0),
                            axis=1).sum()
    axes.set(aspect='equal', xlabel='x [m]', ylabel='y [m]',
             title=f'trajectory from above, {length:.1f} m')
    # a straight drive is no reason for a picture of one line's height
    half = max(0.55 * np.ptp(xy, axis=0).max(), 1.0)
    middle = (xy.min(axis=0) + xy.max(axis=0)) / 2
    axes.set(xlim=(middle[0] - half, middle[0] + half),
             ylim=(middle[1] - half, middle[1] + half))
    axes.legend(loc='best')


def _draw_times(axes: Any, time_s: Array, milliseconds: Array) -> None:
    taken = milliseconds[np.isfinite(milliseconds)]
    axes.plot(time_s, milliseconds, '.-', color=BLUE, lw=1, ms=4)
    axes.axhline(float(np.median(taken)), color=GREY, lw=1)
    period = float(np.median(np.diff(time_s))) * 1e3 if len(time_s) > 1 else 0.0
    top = float(taken.max())
    if 0 < period < 3 * top:
        axes.axhline(period, color=ORANGE, lw=1.2, ls='--')
        axes.annotate(f'{period:.0f} ms between scans', (time_s[-1], period), color=ORANGE,
                      ha='right', va='bottom', xytext=(0, 2), textcoords='offset points')
        top = max(top, period)
    axes.set(ylim=(0, 1.15 * top), ylabel='time [ms]',
             title=f'time per scan: median {np.median(taken):.0f} ms, '
                   f'p95 {np.percentile(taken, 95):.0f} ms')


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
    from matplotlib.collections import LineCollection
    ends = np.stack((source[:, :2], target[:, :2]), axis=1)
    for part, limit, colour, width, alpha in ((ends[~inliers], SHOWN_REJECTED, RED, 0.5, 0.3),
                                              (ends[inliers], SHOWN_INLIERS, GREEN, 0.9, 0.8)):
        axes.add_collection(LineCollection(list(part[::max(1, len(part) // limit)]),
                                           colors=colour, linewidths=width, alpha=alpha))


def _frame_clouds(panels: Sequence[Any], xy: NDArray[Any]) -> None:
    """Show where nearly all points are: a few far returns would make the picture tiny."""
    cut = (1 - SHOWN_SHARE) / 2
    low, high = np.quantile(xy, (cut, 1 - cut), axis=0)
    margin = 0.06 * (high - low).max()
    for axes in panels:
        axes.set(xlim=(low[0] - margin, high[0] + margin),
                 ylim=(low[1] - margin, high[1] + margin))
