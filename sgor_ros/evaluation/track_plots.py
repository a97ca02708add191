"""Pictures of a track against ground truth."""
from pathlib import Path
from typing import Protocol

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from .track import TrackErrors

Array = NDArray[np.float64]

TRUTH, ESTIMATE, LIMIT = '#111111', '#ff5a1f', '#888888'
# raw SemanticKITTI ids: name, colour; drawn in this order
CLASSES = {
    72: ('terrain', '#dfe9d3'), 40: ('road', '#c9c9cf'), 48: ('sidewalk', '#e6d9e2'),
    50: ('building', '#8a7462'), 51: ('fence', '#c49a6c'), 70: ('vegetation', '#74a65a'),
    71: ('trunk', '#6b4a2b'), 10: ('car', '#3d7dc4'), 80: ('pole', '#b33c86'),
    81: ('traffic sign', '#b33c86'), 99: ('other', '#777777')}
GROUND = (72, 40, 48)
MARGIN_M = 22.0


class LabelledPoints(Protocol):
    """Points (P, 3), metres, with raw SemanticKITTI labels (P,)."""

    @property
    def points(self) -> Array:
        """Return the points."""

    @property
    def labels(self) -> NDArray[np.uint32]:
        """Return the labels."""


def plot_track(path: Path, errors: TrackErrors, T_world_sensor: Array, world: LabelledPoints
               ) -> None:
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
    """
    truth, estimate = T_world_sensor[:, :2, 3], errors.estimate[:, :2, 3]
    low, high = (f(np.vstack((truth, estimate)), axis=0) for f in (np.min, np.max))
    low, high = low - MARGIN_M, high + MARGIN_M
    width, height = high - low
    figure = Figure(figsize=(12, max(4.5, min(11.0, 1.0 + 11 * height / width))),
                    layout='constrained')
    axes = figure.add_subplot()
    _draw_world(axes, world, low, high)
    _draw_tracks(axes, truth, estimate, 3.5)
    axes.plot(*truth[0], 'o', color='white', mec=TRUTH, mew=2, ms=9, label='start', zorder=5)
    axes.plot(*truth[-1], 's', color='white', mec=TRUTH, mew=2, ms=9, label='end', zorder=5)
    axes.set(xlabel='x [m]', ylabel='y [m]', aspect='equal', xlim=(low[0], high[0]),
             ylim=(low[1], high[1]))
    axes.set_title(f'{len(estimate)} of {len(truth)} scans, {errors.length_m:.0f} m: drift '
                   f'{errors.drift.translation_percent:.2f} %, end '
                   f'{100 * errors.end_translation_m:.0f} cm and '
                   f'{errors.end_rotation_deg:.2f} deg off', loc='left', weight='bold')
    figure.legend(loc='outside right upper', markerscale=1.0, framealpha=1.0)
    figure.savefig(path, dpi=130, bbox_inches='tight')


def _draw_world(axes: Axes, world: LabelledPoints, low: Array, high: Array) -> None:
    xy = world.points[:, :2]
    near = np.all((xy > low) & (xy < high), axis=1)
    for label, (name, colour) in CLASSES.items():
        chosen = near & (world.labels == label)
        axes.scatter(xy[chosen, 0], xy[chosen, 1], s=0.5 if label in GROUND else 1.2, c=colour,
                     linewidths=0)
        if chosen.any():
            axes.plot([], [], 's', color=colour, ms=8, label=name)


def _draw_tracks(axes: Axes, truth: Array, estimate: Array, width: float) -> None:
    axes.plot(*truth.T, '-', color=TRUTH, lw=width, label='ground truth')
    axes.plot(*estimate.T, '.-', color=ESTIMATE, lw=width / 3, ms=4, label='sgor_node')


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
    figure = Figure(figsize=(12, 7.5), layout='constrained')
    top, middle, bottom = figure.subplots(3, sharex=True)
    _draw_series(top, scans[1:], 100 * errors.translation_m, 'TE of the pair [cm]', '{:.2f} cm')
    _draw_series(middle, scans[1:], errors.rotation_deg, 'RE of the pair [deg]', '{:.3f} deg')
    _draw_series(bottom, scans, 1e3 * seconds, 'time per scan [ms]', '{:.0f} ms')
    bottom.axhline(1e3 * period_s, color=LIMIT, ls='--', lw=1)
    bottom.annotate(f'{1 / period_s:g} Hz', (scans[0], 1e3 * period_s), xytext=(0, 3),
                    textcoords='offset points', color=LIMIT)
    bottom.set(xlabel='scan', ylim=(0, 1.2e3 * max(period_s, float(np.nanmax(seconds)))))
    figure.savefig(path, dpi=130)


def _draw_series(axes: Axes, x: NDArray[np.int_], y: Array, label: str, unit: str) -> None:
    median, p95 = np.nanmedian(y), np.nanquantile(y, 0.95)
    axes.plot(x, y, '.-', color=ESTIMATE, lw=0.9, ms=5)
    axes.axhline(float(median), color=TRUTH, lw=1)
    axes.set(ylabel=label, ylim=(0, None))
    axes.set_title(f'median {unit.format(median)}, p95 {unit.format(p95)}', fontsize=10,
                   loc='left')
    axes.grid(alpha=0.25)
