"""Pictures of what was measured."""
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter
from matplotlib.ticker import LogLocator
from matplotlib.ticker import NullFormatter
import numpy as np

from .report import at_threshold
from .report import in_band
from .run import Row
from .sequences import SETTLED
from .sequences import Track
from .solver import Solved

DPI = 130
BANDS_M = tuple((float(low), float(low + 6)) for low in range(0, 36, 6))


def plot_pairs(path: Path, rows: Sequence[Row], methods: Sequence[str]) -> None:
    """Draw recall over distance, time and errors of each method."""
    figure = Figure(figsize=(14, 8), layout='constrained')
    (top, slow), (turned, moved) = figure.subplots(2, 2)
    right = {name: [row for row in rows if row.method == name and row.right] for name in methods}
    for index, name in enumerate(methods):
        bands = [(low, band) for low, high in BANDS_M if (band := in_band(right[name], low, high))]
        top.plot([low + 3 for low, _ in bands],
                 [100 * np.mean([row.success for row in band]) for _, band in bands],
                 'o-', color=f'C{index}', label=name, lw=1.6, ms=5)
    top.set(xlabel='distance of the sensors [m]', ylabel='recall [%]', ylim=(-3, 103))
    figure.legend(loc='outside lower center', ncols=4)
    _spread(slow, {name: [1e3 * row.seconds for row in own] for name, own in right.items()},
           'two raw scans to transform [ms]')
    _spread(turned, {name: [row.rotation_error_deg for row in own if row.success]
                    for name, own in right.items()}, 'RE of successes [deg]')
    _spread(moved, {name: [100 * row.translation_error_m for row in own if row.success]
                   for name, own in right.items()}, 'TE of successes [cm]')
    top.grid(alpha=0.25)
    figure.savefig(path, dpi=DPI)


def _spread(axes: Axes, values: dict[str, list[float]], label: str) -> None:
    """Draw for each name the median, the quartiles, and 5 to 95 %."""
    for index, (name, own) in enumerate(values.items()):
        if own:
            low, first, median, third, high = np.percentile(own, (5, 25, 50, 75, 95))
            axes.hlines(name, low, high, color=f'C{index}', lw=2)
            axes.hlines(name, first, third, color=f'C{index}', lw=11, alpha=0.6)
            axes.plot(median, name, '|', color='black', ms=14, mew=2)
        else:
            axes.plot(np.nan, name)    # keeps its line
    axes.invert_yaxis()
    _logarithmic(axes, 'x')
    axes.set_title(f'{label}: median, quartiles, 5 to 95 %', fontsize=10, loc='left')
    axes.grid(alpha=0.25, axis='x', which='both')


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
    kinds = {'right answers': ([r for r in rows if r.right and r.within], '#2a7f3f'),
             'right pairs, wrong answer': ([r for r in rows if r.right and not r.within],
                                           '#e0a100'),
             'wrong pairs': ([r for r in rows if not r.right and not r.within], '#c0392b')}
    for name, (part, colour) in kinds.items():
        if part:
            top.hist([row.score for row in part], np.linspace(0, 1, 41), color=colour, alpha=0.65,
                     label=f'{name} ({len(part)})',
                     weights=np.full(len(part), 100 / len(part)))
    top.set(ylabel='share of its kind [%]')
    thresholds = np.linspace(0, 1, 201)
    curves = list(zip(*(at_threshold(rows, t) for t in thresholds), strict=True))
    for shares, name, colour, style in zip(
            curves, ('right answers refused', 'of pairs within 20 m',
                     'wrong answers of right pairs accepted', 'wrong pairs accepted'),
            ('#2a7f3f', '#2a7f3f', '#e0a100', '#c0392b'), ('-', ':', '-', '-'), strict=True):
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
    axes.barh(methods, [100 * np.mean([row.success for row in part]) for part in own])
    slow.barh(methods, [1e3 * np.median([row.seconds for row in part]) for part in own])
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
        above.plot(*own[0].truth[:, :2, 3].T, color='black', lw=3, label='truth')
        for track in own:
            estimate = track.errors.estimate
            above.plot(*estimate[:, :2, 3].T, '.-', lw=1, ms=3, label=track.method)
            off = np.linalg.norm(estimate[:, :3, 3] - track.truth[:, :3, 3], axis=1)
            error.plot(100 * off, lw=1.4, label=track.method)
            slow.plot(np.arange(SETTLED, len(off)), 1e3 * track.seconds[SETTLED:], lw=1,
                      label=track.method)
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
    for index, solver in enumerate(dict.fromkeys(row.solver for row in rows)):
        for made_up, style in ((True, 'o-'), (False, 'x')):
            own = sorted((row.count, 1e3 * row.seconds_median) for row in rows
                         if row.solver == solver and (row.matches == 'made up') is made_up)
            if own:
                axes.plot(*zip(*own, strict=True), style, color=f'C{index}', ms=7,
                          label=solver if made_up else f'{solver}, real matches')
    _logarithmic(axes, 'x')
    _logarithmic(axes, 'y')
    axes.set(xlabel='correspondences', ylabel='time [ms]')
    axes.grid(alpha=0.25, which='both')
    axes.legend()
    figure.savefig(path, dpi=DPI)
