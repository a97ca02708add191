"""Tables of registrations of pairs."""
from collections.abc import Iterable
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..metrics.registration import EASY
from ..metrics.registration import registration_recall
from ..protocols.ablation import PAPER_ROWS
from ..rows import Row
from .cells import errors
from .cells import in_band
from .cells import markdown
from .cells import recall
from .cells import times

BANDS_M = ((0.0, 10.0), (10.0, 20.0), (20.0, 36.0))
RULE = (f'Recall: answered, not refused, and within {EASY.rotation_deg:g} deg and '
        f'{100 * EASY.translation_m:g} cm of the truth (nuScenes: in x and y). RE and TE: median '
        '/ mean over those. Times: median / p95.')


def pairs_table(rows: Sequence[Row], methods: Sequence[str], memory: dict[str, float]) -> str:
    """Return the table of all methods: recall, errors, times, memory, false accepts."""
    header = ['method', 'recall', *(f'{low:g}-{high:g} m' for low, high in BANDS_M), 'RE [deg]',
              'TE [cm]', 'time [ms]', 'one new scan [ms]', 'peak memory [MB]',
              'wrong answers of right pairs', 'wrong pairs accepted']
    lines = []
    for name in methods:
        right, wrong = ([row for row in rows if row.method == name and row.same_place is kind]
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
    right = [row for row in rows if row.same_place]
    lines = []
    for data_set in sorted({row.group for row in right}):
        for name in methods:
            some = [row for row in right if (row.method, row.group) == (name, data_set)]
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


def at_threshold(rows: Sequence[Row], threshold: float) -> tuple[NDArray[np.bool_], ...]:
    """Tell for each answer of four kinds whether a threshold would get it wrong.

    Returns
    -------
    tuple of (K,) bool
        Right answers refused; of pairs within 20 m; wrong answers to right pairs accepted; wrong
        pairs accepted.
    """
    right = [row for row in rows if row.same_place and row.correct]
    near = [row for row in right if row.distance_m <= BANDS_M[-1][0]]
    bad = [row for row in rows if row.same_place and not row.correct]
    wrong = [row for row in rows if not row.same_place and not row.correct]
    return (*(np.array([row.score < threshold for row in part], bool) for part in (right, near)),
            *(np.array([row.score >= threshold for row in part], bool) for part in (bad, wrong)))


def paper_table(rows: Sequence[Row]) -> str:
    """Return the paper's table beside ours: which way each row went in both."""
    lines = []
    whole = _percent(rows, 'paper')
    for row in PAPER_ROWS:
        own = [r for r in rows if r.method == row.method]
        there = here = '*'
        if row.changes:
            there = f'{row.recall - PAPER_ROWS[1].recall:+.1f}'
            here = f'{_percent(rows, row.method) - whole:+.1f}'
        lines.append([f'{row.number}) {row.name}', f'{row.recall:.2f} %', there, recall(own), here,
                      *errors(own)])
    return markdown(['row of the paper', 'its RR', 'against its default', 'recall here',
                     'against the default here', 'RE [deg]', 'TE [cm]'], lines)


def _percent(rows: Sequence[Row], method: str) -> float:
    own = [row.success for row in rows if row.method == method]
    return registration_recall(own) if own else 0.0
