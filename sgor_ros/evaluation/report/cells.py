"""Cells of tables, each defined once: recall, errors, times; and tables in Markdown and LaTeX."""
from collections.abc import Iterable
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..metrics.registration import registration_recall
from ..rows import Row

ENOUGH = 20
"""With fewer runs a time is no figure."""


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table whose first column is text and whose others are numbers."""
    lines = [header, ['---', *['---:'] * (len(header) - 1)], *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def latex(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table for a paper (booktabs)."""
    lines = [r'\begin{tabular}{l' + 'c' * (len(header) - 1) + '}', r'\toprule',
             ' & '.join(map(_escaped, header)) + r' \\', r'\midrule',
             *(' & '.join(_escaped(cell) or '--' for cell in row) + r' \\' for row in rows),
             r'\bottomrule', r'\end{tabular}']
    return '\n'.join(lines)


def _escaped(cell: str) -> str:
    return cell.replace('%', r'\%').replace('_', r'\_')


def in_band(rows: Sequence[Row], low_m: float, high_m: float) -> list[Row]:
    """Return the rows of pairs so far apart."""
    return [row for row in rows if low_m <= row.distance_m < high_m]


def recall(rows: Sequence[Row]) -> str:
    """Return the share of successes and their count."""
    won = [row.success for row in rows]
    return f'{registration_recall(won):.1f} % ({sum(won)}/{len(won)})' if won else '-'


def errors(rows: Sequence[Row]) -> tuple[str, str]:
    """Return RE and TE of the successes, each as median / mean."""
    won = [row for row in rows if row.success]
    if not won:
        return '-', '-'
    re = np.array([row.rotation_error_deg for row in won])
    te = np.array([row.translation_error_m for row in won])
    return (f'{np.median(re):.2f} / {np.mean(re):.2f}',
            f'{100 * np.median(te):.1f} / {100 * np.mean(te):.1f}')


def times(seconds: Sequence[float] | NDArray[np.float64]) -> str:
    """Return median / p95 in milliseconds, with a mark where they are too few."""
    taken = 1e3 * np.array(seconds, np.float64)
    if not np.isfinite(taken).any():
        return '-'
    mark = '' if len(taken) >= ENOUGH else f' (only {len(taken)})'
    return f'{np.nanmedian(taken):.0f} / {np.nanpercentile(taken, 95):.0f}{mark}'


def by_method(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each method, in the order of the first."""
    found: dict[str, list[Row]] = {}
    for each in rows:
        found.setdefault(each.method, []).append(each)
    return found


def percent(right: Sequence[bool]) -> str:
    """Return a share with two digits, as the literature prints it."""
    return f'{registration_recall(right):.2f}' if right else ''


def mean(values: Sequence[float], digits: int) -> str:
    """Return the mean of those that are numbers; empty without any."""
    known = [v for v in values if not np.isnan(v)]
    return f'{np.mean(known):.{digits}f}' if known else ''
