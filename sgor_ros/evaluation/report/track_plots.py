"""Pictures of a track of poses, alone or against ground truth."""
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...io.colours import CLASSES
from ...io.colours import ESTIMATE
from ...io.colours import GROUND
from ...io.colours import INLIER
from ...io.colours import LIMIT
from ...io.colours import LOST
from ...io.colours import SERIES
from ...io.colours import SURE
from ...io.colours import TRUTH
from ...io.plots import new_figure
from ...io.plots import save
from ..metrics.trajectory import TrackErrors
from ..metrics.trajectory import travelled_m

Array = NDArray[np.float64]

MARGIN_M = 22.0
# of the longer side, so that a straight drive is no picture of one line's height
SQUARE_MARGIN = 0.05
DOTTED = 300
# of the first, second and so on of several tracks; red is for what is lost
COLOURS = [colour for colour, _, _ in SERIES if colour != LOST]


class LabelledPoints(Protocol):
    """Points (P, 3), metres, with raw SemanticKITTI labels (P,)."""

    @property
    def points(self) -> Array:
        """Return the points."""

    @property
    def labels(self) -> NDArray[np.uint32]:
        """Return the labels."""


def plot_track(path: str | Path, title: str, stamps_s: Sequence[float],
               poses: Sequence[Array | None], seconds: Sequence[float],
               confidence: Sequence[float], tracks: Sequence[int],
               truth: Mapping[int, Array]) -> None:
    """Draw the tracks of a drive from above, and time and confidence of each scan.

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
    tracks : sequence of int
        Which track each scan belongs to: only poses of one are in one frame.
    truth : mapping of int to (M, 4, 4) array
        Where they are known, the true poses in the frame of each track.
    """
    figure = new_figure(13, 6.2)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1))
    above, upper = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    lower = figure.add_subplot(grid[1, 1], sharex=upper)
    figure.suptitle(title, x=0.02, ha='left', weight='bold')
    known = [i for i, T in enumerate(poses) if T is not None]
    length_m, several = 0.0, list(dict.fromkeys(tracks[i] for i in known))
    for number, track in enumerate(several):
        scans = np.array([i for i in known if tracks[i] == track])
        part = np.array([poses[i] for i in scans])
        length_m += travelled_m(part)[-1]
        if track in truth:
            above.plot(*truth[track][:, :2, 3].T, '-', color=TRUTH, lw=3.5,
                       label='' if number else 'ground truth')
        _draw_one_of(above, part[:, :2, 3], scans, number, len(several))
    xy = np.array([T[:2, 3] for T in (*poses, *(T for of in truth.values() for T in of))
                   if T is not None])
    middle, half = (xy.min(axis=0) + xy.max(axis=0)) / 2, np.ptp(xy, axis=0).max() / 2
    half = max(half * (1 + 2 * SQUARE_MARGIN), 1.0)
    _frame(above, middle - half, middle + half)
    _title(above, f'from above, {length_m:.1f} m' + (
        f' in {len(several)} tracks, each from its own origin' if len(several) > 1 else ''))
    above.legend(loc='best')
    time_s = np.asarray(stamps_s) - stamps_s[0]
    _draw_times(upper, time_s, np.asarray(seconds),
                float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0)
    lower.plot(time_s, confidence, '.-', color=SURE, lw=1, ms=4)
    lost = np.setdiff1d(np.arange(len(poses)), known)
    for t in time_s[lost]:
        lower.axvline(t, color=LOST, lw=1)
    lower.set(ylim=(0, 1.05), ylabel='confidence', xlabel='time since the first scan [s]')
    _title(lower, f'{len(lost)} scans without a pose (red)' if len(lost)
           else 'no scan without a pose')
    save(figure, path)


def plot_against_truth(path: Path, errors: TrackErrors, T_world_sensor: Array,
                       world: LabelledPoints, loops: Sequence[tuple[Array, Array]] = ()) -> None:
    """Draw truth and track from above.

    Parameters
    ----------
    path : Path
        PNG to write.
    errors : TrackErrors
    T_world_sensor : (N, 4, 4) array
        The truth, of all scans.
    world : LabelledPoints
        The surroundings in the frame of the truth.
    loops : sequence of pairs of (4, 4) array
        True poses of both scans of each loop that was closed.
    """
    truth, estimate = T_world_sensor[:, :2, 3], errors.estimate[:, :2, 3]
    both = np.vstack((truth, estimate))
    low, high = both.min(axis=0) - MARGIN_M, both.max(axis=0) + MARGIN_M
    width, height = high - low
    figure = new_figure(12, max(4.5, min(11.0, 1.0 + 10 * height / width)), 'compressed')
    axes = figure.add_subplot()
    _draw_world(axes, world, low, high)
    axes.plot(*truth.T, '-', color=TRUTH, lw=3.5, label='ground truth')
    _draw_track(axes, estimate, 1.2)
    for number, loop in enumerate(loops):
        axes.plot(*np.array(loop)[:, :2, 3].T, '-', color=INLIER, lw=1.5, zorder=4,
                  label='' if number else f'{len(loops)} loops closed')
    _draw_ends(axes, truth)
    _frame(axes, low, high)
    _title(axes, f'{len(estimate)} of {len(truth)} scans, {errors.length_m:.0f} m: drift '
           f'{errors.drift.translation_percent:.2f} %, end '
           f'{100 * errors.end_translation_m:.0f} cm and {errors.end_rotation_deg:.2f} deg off')
    axes.legend(loc='upper left', bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, frameon=False)
    save(figure, path)


def plot_errors(path: Path, errors: TrackErrors, scans: NDArray[np.int_], seconds: Array,
                period_s: float) -> None:
    """Draw the errors of consecutive pairs and the time of each scan, one below the other.

    Parameters
    ----------
    path : Path
        PNG to write.
    errors : TrackErrors
    scans : (N,) array of int
        Numbers of the scans that have a pose.
    seconds : (N,) array
        Time per scan.
    period_s : float
        Time between scans: what there is for each.
    """
    figure = new_figure(12, 7.5)
    top, middle, bottom = figure.subplots(3, sharex=True)
    _draw_series(top, scans[1:], 100 * errors.translation_m, 'TE of the pair [cm]', '{:.2f} cm')
    _draw_series(middle, scans[1:], errors.rotation_deg, 'RE of the pair [deg]', '{:.3f} deg')
    _draw_times(bottom, scans, seconds, period_s)
    bottom.set_xlabel('scan')
    save(figure, path)


def _title(axes: Any, text: str) -> None:
    axes.set_title(text, loc='left', fontsize=10, weight='bold')


def _draw_one_of(axes: Any, xy: Array, scans: NDArray[np.int_], number: int, count: int) -> None:
    """Draw one of several tracks in a colour of its own, with red where scans have no pose."""
    colour = ESTIMATE if count == 1 else COLOURS[number % len(COLOURS)]
    named = number < len(COLOURS)
    _draw_track(axes, xy, 2, colour, '' if not named else
                'track' if count == 1 else f'track {number + 1}')
    for i in np.flatnonzero(np.diff(scans) > 1):
        axes.plot(*xy[i:i + 2].T, '-', color=LOST, lw=2.5)
    _draw_ends(axes, xy, named=number == 0)


def _draw_track(axes: Any, xy: Array, width: float, colour: str = ESTIMATE,
                label: str = 'track') -> None:
    dots = '.-' if len(xy) < DOTTED else '-'
    axes.plot(*xy.T, dots, color=colour, lw=width, ms=4, label=label)


def _draw_ends(axes: Any, xy: Array, *, named: bool = True) -> None:
    for end, marker, label in ((xy[0], 'o', 'start'), (xy[-1], 's', 'end')):
        axes.plot(*end, marker, color='white', mec=TRUTH, mew=2, ms=9, zorder=5,
                  label=label if named else '')


def _frame(axes: Any, low: Array, high: Array) -> None:
    axes.set(xlabel='x [m]', ylabel='y [m]', aspect='equal', xlim=(low[0], high[0]),
             ylim=(low[1], high[1]))


def _draw_world(axes: Any, world: LabelledPoints, low: Array, high: Array) -> None:
    xy = world.points[:, :2]
    near = np.all((xy > low) & (xy < high), axis=1)
    for label, (name, colour) in CLASSES.items():
        chosen = near & (world.labels == label)
        axes.scatter(xy[chosen, 0], xy[chosen, 1], s=0.5 if label in GROUND else 1.2, c=colour,
                     linewidths=0)
        if chosen.any():
            axes.plot([], [], 's', color=colour, ms=8, label=name)


def _draw_series(axes: Any, x: NDArray[Any], y: Array, label: str, unit: str) -> None:
    median, p95 = np.nanmedian(y), np.nanquantile(y, 0.95)
    axes.plot(x, y, '.-' if len(x) < DOTTED else '-', color=ESTIMATE, lw=0.9, ms=5)
    axes.axhline(float(median), color=TRUTH, lw=1)
    axes.set(ylabel=label, ylim=(0, None))
    _title(axes, f'median {unit.format(median)}, p95 {unit.format(p95)}')


def _draw_times(axes: Any, x: NDArray[Any], seconds: Array, period_s: float) -> None:
    """Draw the time per scan, and what there is where that is not far off."""
    _draw_series(axes, x, 1e3 * seconds, 'time per scan [ms]', '{:.0f} ms')
    top = 1e3 * float(np.nanmax(seconds))
    period = 1e3 * period_s
    if 0 < period < 3 * top:
        axes.axhline(period, color=LIMIT, ls='--', lw=1)
        axes.annotate(f'{period:.0f} ms\nbetween\nscans', (1.0, period), xytext=(4, 0),
                      xycoords=('axes fraction', 'data'), textcoords='offset points',
                      color=LIMIT, va='center', fontsize=9, annotation_clip=False)
        top = max(top, period)
    axes.set_ylim(0, 1.2 * top)
