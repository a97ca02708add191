"""Tables of `sgor_benchmark`."""
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import fields
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metrics.consistency import ScanConsistency
from ..metrics.registration_recall import at_threshold
from ..metrics.registration_recall import EASY
from ..metrics.registration_recall import registration_recall
from ..metrics.row import Row
from ..protocols.ablation import PAPER_ROWS
from ..sequences import SETTLED
from ..sequences import Track
from ..solver import Solved

BANDS_M = ((0.0, 10.0), (10.0, 20.0), (20.0, 36.0))
ENOUGH = 20
"""With fewer runs a time is no figure."""

_CLAIMS = [field.name for field in fields(ScanConsistency)]

RULE = (f'Recall: answered, not refused, and within {EASY.rotation_deg:g} deg and '
        f'{100 * EASY.translation_m:g} cm of the truth (nuScenes: in x and y). RE and TE: median '
        '/ mean over those. Times: median / p95.')


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table whose first column is text and whose others are numbers."""
    lines = [header, ['---', *['---:'] * (len(header) - 1)], *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def pairs_table(rows: Sequence[Row], methods: Sequence[str], memory: dict[str, float]) -> str:
    """Return the table of all methods: recall, errors, times, memory, false accepts."""
    header = ['method', 'recall', *(f'{low:g}-{high:g} m' for low, high in BANDS_M), 'RE [deg]',
              'TE [cm]', 'time [ms]', 'one new scan [ms]', 'peak memory [MB]',
              'wrong answers of right pairs', 'wrong pairs accepted']
    lines = []
    for name in methods:
        right, wrong = ([row for row in rows if row.method == name and row.right is kind]
                        for kind in (True, False))
        lines.append([
            name, recall(right), *(recall(in_band(right, *band)) for band in BANDS_M),
            *errors(right), times([row.seconds for row in right]),
            times([row.seconds_one_new for row in right]),
            f'{memory[name]:.0f}' if name in memory else '-',
            f'{sum(row.false_accept for row in right)} of {len(right)}',
            (f'{sum(row.false_accept for row in wrong)} of {len(wrong)}' if wrong
             else 'never refuses')])
    return markdown(header, lines)


def data_sets_table(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Return recall, errors and times of the right pairs by data set."""
    right = [row for row in rows if row.right]
    lines = []
    for data_set in sorted({row.data_set for row in right}):
        for name in methods:
            some = [row for row in right if (row.method, row.data_set) == (name, data_set)]
            lines.append([f'{data_set}: {name}', recall(some),
                          *(recall(in_band(some, *band)) for band in BANDS_M), *errors(some),
                          times([row.seconds for row in some])])
    return markdown(['data set: method', 'recall', *(f'{low:g}-{high:g} m' for low, high
                     in BANDS_M), 'RE [deg]', 'TE [cm]', 'time [ms]'], lines)


def ablation_table(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Return what is left of recall and accuracy, and the time, in each of the settings."""
    far = BANDS_M[-1]
    lines = []
    for name in methods:
        own = [row for row in rows if row.method == name]
        lines.append([name, recall(own), recall(in_band(own, *far)),
                      str(sum(row.false_accept for row in own)), *errors(own),
                      times([row.seconds for row in own])])
    return markdown(['settings', 'recall', f'{far[0]:g}-{far[1]:g} m', 'wrong answers', 'RE [deg]',
                     'TE [cm]', 'time [ms]'], lines)


def paper_table(rows: Sequence[Row]) -> str:
    """Return the paper's table beside ours: which way each row went in both."""
    lines = []
    whole = 100 * registration_recall([r for r in rows if r.method == 'paper'])
    for row in PAPER_ROWS:
        own = [r for r in rows if r.method == row.method]
        there = here = '*'
        if row.changes:
            there = f'{row.recall - PAPER_ROWS[1].recall:+.1f}'
            here = f'{100 * registration_recall(own) - whole:+.1f}'
        lines.append([f'{row.number}) {row.name}', f'{row.recall:.2f} %', there, recall(own), here,
                      *errors(own)])
    return markdown(['row of the paper', 'its RR', 'against its default', 'recall here',
                     'against the default here', 'RE [deg]', 'TE [cm]'], lines)


def confidence_table(rows: Sequence[Row], thresholds: Iterable[float], default: float) -> str:
    """Return what each threshold would refuse of the right and accept of the wrong."""
    lines = []
    for threshold in thresholds:
        shares = [f'{100 * part.mean():.1f} % ({part.sum()} of {len(part)})' if len(part) else '-'
                  for part in at_threshold(rows, threshold)]
        mark = ' (default)' if threshold == default else ''
        lines.append([f'{threshold:.2f}{mark}', *shares])
    return markdown(['min_confidence', 'right answers refused', 'of pairs within 20 m',
                     'wrong answers of right pairs accepted', 'wrong pairs accepted'], lines)


def sequence_table(tracks: Sequence[Track]) -> str:
    """Return drift, errors from scan to scan and times."""
    lines = []
    for track in tracks:
        found = track.errors
        lines.append([
            f'{track.drive}: {track.method}', f'{len(track.truth)}', f'{found.length_m:.0f}',
            f'{track.lengths_m[0]:g}-{track.lengths_m[-1]:g}',
            f'{found.drift.translation_percent:.2f}', f'{found.drift.rotation_deg_per_m:.4f}',
            f'{100 * np.median(found.translation_m):.1f}', f'{np.median(found.rotation_deg):.3f}',
            str(track.without_pose), times(track.seconds[SETTLED:]),
            times(track.cpu_seconds[SETTLED:])])
    return markdown(['drive: method', 'scans', 'way [m]', 'stretches [m]', 'drift [%]',
                     'drift [deg/m]', 'TE of a step [cm]', 'RE of a step [deg]',
                     'without a pose', 'time a scan [ms]', 'CPU time a scan [ms]'], lines)


def scan_records(tracks: Sequence[Track]) -> list[dict[str, Any]]:
    """Return a line a scan: error of the pose and time, and what the tracker claims of it."""
    return [{'drive': track.drive, 'method': track.method, 'scan': scan,
             'off_the_truth_m': float(off), 'seconds': seconds, 'cpu_seconds': cpu,
             **(asdict(track.consistency[scan]) if track.consistency
                else dict.fromkeys(_CLAIMS, ''))}
            for track in tracks for scan, (off, seconds, cpu) in enumerate(
                zip(track.errors.ape_m, track.seconds, track.cpu_seconds, strict=True))]


def solver_table(rows: Sequence[Solved]) -> str:
    """Return times and errors of each solver on each set of matches."""
    return markdown(
        ['matches', 'count', 'right [%]', 'pairs consistent [%]', 'solver', 'time [ms]',
         'CPU [ms]', 'time / count^2 [ns]', 'runs', 'RE [deg]', 'TE [cm]'],
        [[row.matches, str(row.count), f'{100 * row.inlier_share:.2f}',
          f'{100 * row.consistent_share:.2f}', row.solver,
          f'{1e3 * row.seconds_median:.1f} / {1e3 * row.seconds_p95:.1f}',
          f'{1e3 * row.cpu_seconds:.1f}', f'{1e9 * row.seconds_median / row.count**2:.2f}',
          str(row.runs),
          *(('failed', 'failed') if math.isnan(row.rotation_error_deg) else
            (f'{row.rotation_error_deg:.3f}', f'{100 * row.translation_error_m:.1f}'))]
         for row in rows])


def in_band(rows: Sequence[Row], low_m: float, high_m: float) -> list[Row]:
    """Return the rows of pairs so far apart."""
    return [row for row in rows if low_m <= row.distance_m < high_m]


def recall(rows: Sequence[Row]) -> str:
    """Return the share of successes and their count."""
    won = sum(row.success for row in rows)
    return f'{100 * registration_recall(rows):.1f} % ({won}/{len(rows)})' if rows else '-'


def errors(rows: Sequence[Row]) -> tuple[str, str]:
    """Return RE and TE of the successes, each as median / mean."""
    won = [row for row in rows if row.success]
    if not won:
        return '-', '-'
    re, te = (np.array([value(row) for row in won]) for value in ERRORS)
    return (f'{np.median(re):.2f} / {np.mean(re):.2f}',
            f'{100 * np.median(te):.1f} / {100 * np.mean(te):.1f}')


ERRORS: tuple[Callable[[Row], float], ...] = (
    lambda row: row.rotation_error_deg, lambda row: row.translation_error_m)


def times(seconds: Sequence[float] | NDArray[np.float64]) -> str:
    """Return median / p95 in milliseconds, with a mark where they are too few."""
    taken = 1e3 * np.array(seconds, np.float64)
    if not np.isfinite(taken).any():
        return '-'
    mark = '' if len(taken) >= ENOUGH else f' (only {len(taken)})'
    return f'{np.nanmedian(taken):.0f} / {np.nanpercentile(taken, 95):.0f}{mark}'
