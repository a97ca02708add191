"""Pictures of what was measured."""
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any
from typing import Literal

import numpy as np

from ...io.colours import BLUE
from ...io.colours import DIFFERENT_PLACES
from ...io.colours import GREEN
from ...io.colours import GREY
from ...io.colours import ORANGE
from ...io.colours import RIGHT
from ...io.colours import SERIES
from ...io.colours import SKY
from ...io.colours import TRUTH
from ...io.colours import WRONG
from ...io.plots import new_figure
from ..metrics.calibration import BINS
from ..metrics.calibration import reliability_diagram
from ..metrics.registration import registration_recall
from ..odometry import SETTLED
from ..odometry import Track
from ..protocols.solver import MADE_UP
from ..rows import Row
from .cells import in_band
from .pair_tables import at_threshold
from .solver_table import SolverTimes

DPI = 130
# recall above which letters are white
DARK = 75
FAMILIES = (("SGOR, paper's", SKY), ('SGOR', BLUE), ('KISS', GREEN), ('Open3D', ORANGE))
BANDS_M = tuple((float(low), float(low + 6)) for low in range(0, 36, 6))


def plot_pairs(path: Path, rows: Sequence[Row], methods: Sequence[str]) -> None:
    """Draw recall by distance, time and errors of each method, which has its line everywhere."""
    figure = new_figure(14, 2.4 + 0.75 * len(methods))
    (recall, slow), (turned, moved) = figure.subplots(2, 2, sharey=True)
    right = {name: [row for row in rows if row.method == name and row.same_place]
             for name in methods}
    _recall(recall, right)
    _spread(slow, {name: [1e3 * row.seconds for row in own] for name, own in right.items()},
            'two raw scans to transform [ms]')
    _spread(turned, {name: [row.rotation_error_deg for row in own if row.success]
                     for name, own in right.items()}, 'RE of successes [deg]')
    _spread(moved, {name: [100 * row.translation_error_m for row in own if row.success]
                    for name, own in right.items()}, 'TE of successes [cm]')
    recall.set_yticks(range(len(methods)), methods)
    recall.set_ylim(len(methods) - 0.5, -0.5)
    figure.savefig(path, dpi=DPI)


def _recall(axes: Any, right: dict[str, list[Row]]) -> None:
    """Write the recall of each method and band of distances into a field, dark where high."""
    shares = np.full((len(right), len(BANDS_M)), np.nan)
    for line, own in enumerate(right.values()):
        for column, (low, high) in enumerate(BANDS_M):
            band = in_band(own, low, high)
            if band:
                share = shares[line, column] = registration_recall([row.success for row in band])
                axes.text(column, line, f'{share:.0f}', ha='center', va='center', fontsize=10,
                          color='white' if share > DARK else 'black')
    axes.imshow(shares, cmap='Blues', vmin=0, vmax=120, aspect='auto')
    counts = [len(in_band(next(iter(right.values())), *band)) for band in BANDS_M]
    axes.set_xticks(range(len(BANDS_M)), [f'{low:g} to {high:g} m\n{count} pairs' for
                                          (low, high), count in zip(BANDS_M, counts, strict=True)])
    axes.set_title('recall [%] by distance of the sensors', fontsize=10, loc='left')
    axes.spines[:].set_visible(False)


def _spread(axes: Any, values: dict[str, list[float]], label: str) -> None:
    """Draw for each name the median, the quartiles, and 5 to 95 %."""
    for line, (name, own) in enumerate(values.items()):
        if own:
            low, first, median, third, high = np.percentile(own, (5, 25, 50, 75, 95))
            colour = next((colour for family, colour in FAMILIES if name.startswith(family)), GREY)
            axes.hlines(line, low, high, color=colour, lw=2)
            axes.hlines(line, first, third, color=colour, lw=11, alpha=0.6)
            axes.plot(median, line, '|', color='black', ms=14, mew=2)
            axes.annotate(f'{median:.2g}' if median < 10 else f'{median:.0f}', (median, line),
                          xytext=(0, 9), textcoords='offset points', ha='center', fontsize=8)
    _logarithmic(axes, 'x')
    axes.set_title(f'{label}: median, quartiles, 5 to 95 %', fontsize=10, loc='left')
    axes.grid(alpha=0.25, axis='x')
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)


def _logarithmic(axes: Any, which: Literal['x', 'y']) -> None:
    """Make an axis logarithmic, with plain numbers at 1, 2 and 5 of each decade."""
    from matplotlib.ticker import FormatStrFormatter
    from matplotlib.ticker import LogLocator
    from matplotlib.ticker import NullFormatter
    axes.set(**{f'{which}scale': 'log'})
    axis = axes.xaxis if which == 'x' else axes.yaxis
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FormatStrFormatter('%g'))
    axis.set_minor_formatter(NullFormatter())


def plot_confidence(path: Path, rows: Sequence[Row], default: float) -> None:
    """Draw the confidence of right and wrong answers, and what each threshold gets wrong."""
    figure = new_figure(12, 7.5)
    top, bottom = figure.subplots(2, sharex=True)
    kinds = {'right answers': ([r for r in rows if r.same_place and r.correct], RIGHT),
             'right pairs, wrong answer': (
                 [r for r in rows if r.same_place and not r.correct], WRONG),
             'wrong pairs': ([r for r in rows if not r.same_place and not r.correct],
                             DIFFERENT_PLACES)}
    bins = np.linspace(0, 1, 41)
    for name, (part, colour) in kinds.items():
        if part:
            share = np.histogram([row.score for row in part], bins)[0] * 100 / len(part)
            top.stairs(share, bins, color=colour, lw=2, label=f'{name} ({len(part)})')
            top.stairs(share, bins, color=colour, alpha=0.15, fill=True)
    top.set(ylabel='share of its kind [%]')
    thresholds = np.linspace(0, 1, 201)
    curves = list(zip(*(at_threshold(rows, t) for t in thresholds), strict=True))
    for shares, name, colour, style in zip(
            curves, ('right answers refused', 'of pairs within 20 m',
                     'wrong answers of right pairs accepted', 'wrong pairs accepted'),
            (RIGHT, RIGHT, WRONG, DIFFERENT_PLACES), ('-', ':', '--', '-.'), strict=True):
        if len(shares[0]):
            bottom.plot(thresholds, [100 * part.mean() for part in shares], style, color=colour,
                        lw=2, label=name)
    bottom.set(xlabel='confidence, or threshold', ylabel='share [%]', xlim=(0, 1))
    for axes in (top, bottom):
        axes.axvline(default, color='black', ls='--', lw=1,
                     label=f'min_confidence = {default:g}')
        axes.legend(fontsize=9)
        axes.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI)


def plot_ablation(path: Path, rows: Sequence[Row], methods: Sequence[str]) -> None:
    """Draw recall over distance and median time of each setting."""
    figure = new_figure(12, 0.36 * len(methods) + 1.5)
    axes, slow = figure.subplots(1, 2, sharey=True)
    own = [[row for row in rows if row.method == name] for name in methods]
    axes.barh(methods, [registration_recall([row.success for row in part]) for part in own],
              color=BLUE)
    slow.barh(methods, [1e3 * np.median([row.seconds for row in part]) for part in own],
              color=ORANGE)
    axes.invert_yaxis()
    axes.set(xlabel='recall [%]', xlim=(0, 100))
    slow.set(xlabel='median time [ms]')
    for each in (axes, slow):
        each.grid(alpha=0.25, axis='x')
    figure.savefig(path, dpi=DPI)


def plot_sequences(path: Path, tracks: Sequence[Track]) -> None:
    """Draw, for each drive, the track from above, the growing error and the time of each scan."""
    drives = list(dict.fromkeys(track.drive for track in tracks))
    figure = new_figure(15, 4.6 * len(drives))
    grid = figure.subplots(len(drives), 3, squeeze=False)
    for (above, error, slow), drive in zip(grid, drives, strict=True):
        own = [track for track in tracks if track.drive == drive]
        above.plot(*own[0].truth[:, :2, 3].T, color=TRUTH, lw=3, label='truth')
        for track, (colour, _, line) in zip(own, cycle(SERIES), strict=False):
            estimate, off = track.errors.estimate, track.errors.ape_translation_m
            above.plot(*estimate[:, :2, 3].T, line, color=colour, lw=1.2, label=track.method)
            error.plot(100 * off, line, color=colour, lw=1.4, label=track.method)
            slow.plot(np.arange(SETTLED, len(off)), 1e3 * track.seconds[SETTLED:], line,
                      color=colour, lw=1, label=track.method)
        above.set(xlabel='x [m]', ylabel='y [m]')
        above.set_aspect('equal', adjustable='datalim')
        above.set_title(drive, loc='left', weight='bold')
        error.set(xlabel='scan', ylabel='off the truth [cm]', ylim=(0, None))
        slow.set(xlabel='scan', ylabel='time [ms]', ylim=(0, None))
        error.legend(fontsize=8)
        for axes in (above, error, slow):
            axes.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI)


def plot_solver(path: Path, rows: Sequence[SolverTimes]) -> None:
    """Draw time against count on logarithmic axes."""
    figure = new_figure(9, 6)
    axes = figure.subplots()
    solvers = dict.fromkeys(row.solver for row in rows)
    for solver, (colour, marker, line) in zip(solvers, cycle(SERIES), strict=False):
        for made_up, style in ((True, marker + line), (False, 'x')):
            own = sorted((row.count, 1e3 * row.seconds_median) for row in rows
                         if row.solver == solver and (row.matches == MADE_UP) is made_up)
            if own:
                axes.plot(*zip(*own, strict=True), style, color=colour, ms=7,
                          label=solver if made_up else f'{solver}, real matches')
    _logarithmic(axes, 'x')
    _logarithmic(axes, 'y')
    axes.set(xlabel='correspondences', ylabel='time [ms]')
    axes.grid(alpha=0.25, which='both')
    axes.legend()
    figure.savefig(path, dpi=DPI)


def plot_reliability(path: Path, rows: Sequence[Row], methods: Sequence[str], default: float
                     ) -> None:
    """Draw the share that is right against the confidence, and how many there are of each.

    Parameters
    ----------
    path : Path
        Where to.
    rows : sequence of Row
    methods : sequence of str
        Which of them, a column each.
    default : float
        The threshold below which answers are refused.
    """
    figure = new_figure(6.5 * len(methods), 7.5)
    grid = figure.subplots(2, len(methods), sharex=True, squeeze=False, height_ratios=(2, 1))
    for (top, bottom), name in zip(grid.T, methods, strict=True):
        own = [row for row in rows if row.method == name]
        bins = reliability_diagram(own)
        top.plot((0, 100), (0, 100), ':', color=GREY, label='calibrated')
        top.plot([100 * each.mean for each in bins],
                 [100 * each.right / each.answers for each in bins], 'o-', color=BLUE,
                 label='answers, refused ones too')
        top.set(ylabel='share that is right [%]', ylim=(-3, 103))
        top.set_title(name, loc='left', weight='bold')
        kinds = {
            'right': ([row for row in own if row.same_place and row.correct], RIGHT),
            'wrong answer': ([row for row in own if row.same_place and not row.correct], WRONG),
            'different places': ([row for row in own if not row.same_place], DIFFERENT_PLACES)}
        shown = {kind: ([100 * row.confidence for row in part if not np.isnan(row.confidence)],
                        colour) for kind, (part, colour) in kinds.items()}
        bottom.hist([values for values, _ in shown.values()], 100 * np.array(BINS), stacked=True,
                    color=[colour for _, colour in shown.values()],
                    label=[f'{kind} ({len(values)})' for kind, (values, _) in shown.items()])
        bottom.set(xlabel='confidence [%]', ylabel='answers', xlim=(0, 100))
        for axes in (top, bottom):
            axes.axvline(100 * default, color='black', ls='--', lw=1,
                         label=f'min_confidence = {default:g}')
            axes.grid(alpha=0.25)
            axes.legend(fontsize=9)
    figure.savefig(path, dpi=DPI)
