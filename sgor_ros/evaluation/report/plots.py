"""Pictures of what was measured."""
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter
from matplotlib.ticker import LogLocator
from matplotlib.ticker import NullFormatter
import numpy as np

from ...io.colours import BLUE
from ...io.colours import DIFFERENT
from ...io.colours import GREEN
from ...io.colours import GREY
from ...io.colours import ORANGE
from ...io.colours import RIGHT
from ...io.colours import SERIES
from ...io.colours import SKY
from ...io.colours import TRUTH
from ...io.colours import WRONG
from ..metrics.registration_recall import at_threshold
from ..metrics.row import Row
from ..sequences import SETTLED
from ..sequences import Track
from ..solver import Solved
from .tables import in_band

DPI = 130
# recall above which letters are white
DARK = 75
FAMILIES = (("SGOR, paper's", SKY), ('SGOR', BLUE), ('KISS', GREEN), ('Open3D', ORANGE))
BANDS_M = tuple((float(low), float(low + 6)) for low in range(0, 36, 6))


def plot_pairs(path: Path, rows: Sequence[Row], methods: Sequence[str]) -> None:
    """Draw recall by distance, time and errors of each method, which has its line everywhere."""
    figure = Figure(figsize=(14, 2.4 + 0.75 * len(methods)), layout='constrained')
    (recall, slow), (turned, moved) = figure.subplots(2, 2, sharey=True)
    right = {name: [row for row in rows if row.method == name and row.right] for name in methods}
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


def _recall(axes: Axes, right: dict[str, list[Row]]) -> None:
    """Write the recall of each method and band of distances into a field, dark where high."""
    shares = np.full((len(right), len(BANDS_M)), np.nan)
    for line, own in enumerate(right.values()):
        for column, (low, high) in enumerate(BANDS_M):
            band = in_band(own, low, high)
            if band:
                share = shares[line, column] = 100 * np.mean([row.success for row in band])
                axes.text(column, line, f'{share:.0f}', ha='center', va='center', fontsize=10,
                          color='white' if share > DARK else 'black')
    axes.imshow(shares, cmap='Blues', vmin=0, vmax=120, aspect='auto')
    counts = [len(in_band(next(iter(right.values())), *band)) for band in BANDS_M]
    axes.set_xticks(range(len(BANDS_M)), [f'{low:g} to {high:g} m\n{count} pairs' for
                                          (low, high), count in zip(BANDS_M, counts, strict=True)])
    axes.set_title('recall [%] by distance of the sensors', fontsize=10, loc='left')
    axes.spines[:].set_visible(False)


def _spread(axes: Axes, values: dict[str, list[float]], label: str) -> None:
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


def _logarithmic(axes: Axes, which: Literal['x', 'y']) -> None:
    """Make an axis logarithmic, with plain numbers at 1, 2 and 5 of each decade."""
    axes.set(**{f'{which}scale': 'log'})
    axis: Axis = axes.xaxis if which == 'x' else axes.yaxis
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FormatStrFormatter('%g'))
    axis.set_minor_formatter(NullFormatter())


def plot_confidence(path: Path, rows: Sequence[Row], default: float) -> None:
    """Draw the confidence of right and wrong answers, and what each threshold gets wrong."""
    figure = Figure(figsize=(12, 7.5), layout='constrained')
    top, bottom = figure.subplots(2, sharex=True)
    kinds = {'right answers': ([r for r in rows if r.right and r.within], RIGHT),
             'right pairs, wrong answer': ([r for r in rows if r.right and not r.within], WRONG),
             'wrong pairs': ([r for r in rows if not r.right and not r.within], DIFFERENT)}
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
            (RIGHT, RIGHT, WRONG, DIFFERENT), ('-', ':', '--', '-.'), strict=True):
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
    figure = Figure(figsize=(12, 0.36 * len(methods) + 1.5), layout='constrained')
    axes, slow = figure.subplots(1, 2, sharey=True)
    own = [[row for row in rows if row.method == name] for name in methods]
    axes.barh(methods, [100 * np.mean([row.success for row in part]) for part in own], color=BLUE)
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
    figure = Figure(figsize=(15, 4.6 * len(drives)), layout='constrained')
    grid = figure.subplots(len(drives), 3, squeeze=False)
    for (above, error, slow), drive in zip(grid, drives, strict=True):
        own = [track for track in tracks if track.drive == drive]
        above.plot(*own[0].truth[:, :2, 3].T, color=TRUTH, lw=3, label='truth')
        for track, (colour, _, line) in zip(own, cycle(SERIES), strict=False):
            estimate = track.errors.estimate
            above.plot(*estimate[:, :2, 3].T, line, color=colour, lw=1.2, label=track.method)
            off = track.errors.ape_m
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


def plot_solver(path: Path, rows: Sequence[Solved]) -> None:
    """Draw time against count on logarithmic axes."""
    figure = Figure(figsize=(9, 6), layout='constrained')
    axes = figure.subplots()
    solvers = dict.fromkeys(row.solver for row in rows)
    for solver, (colour, marker, line) in zip(solvers, cycle(SERIES), strict=False):
        for made_up, style in ((True, marker + line), (False, 'x')):
            own = sorted((row.count, 1e3 * row.seconds_median) for row in rows
                         if row.solver == solver and (row.matches == 'made up') is made_up)
            if own:
                axes.plot(*zip(*own, strict=True), style, color=colour, ms=7,
                          label=solver if made_up else f'{solver}, real matches')
    _logarithmic(axes, 'x')
    _logarithmic(axes, 'y')
    axes.set(xlabel='correspondences', ylabel='time [ms]')
    axes.grid(alpha=0.25, which='both')
    axes.legend()
    figure.savefig(path, dpi=DPI)
