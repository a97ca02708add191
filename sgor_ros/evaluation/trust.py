"""How far SGOR can be trusted, by kind of place: what it keeps, refuses, admits and gets wrong."""
from collections.abc import Collection
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .metrics import THREE_SIGMA
from .report import markdown
from .run import Row

BINS = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0)
"""Of confidence; finer where it matters."""

RULE = ('Right: within 5 deg and 60 cm. Kept: with `success`; all others are refused. Degenerate '
        'and ambiguous: refused because the clouds slide on each other, or because several '
        'placements explain them. Outside 3 sigma: degenerate, with an error whose NEES is over '
        f'{THREE_SIGMA:.1f} (chi-square of 6 dimensions, 99.73 %). NEES: mean over what is right '
        'and kept, 6 where the covariance is right, and the share of it up to that bound.')


@dataclass(frozen=True)
class Count:
    """What became of some pairs; all but the last three are numbers of pairs.

    Attributes
    ----------
    same, different : int
        Pairs of the same place, pairs of different places.
    right_kept, right_refused, wrong_accepted : int
        Of the same place: right answers with and without `success`, wrong ones with it.
    degenerate, outside, ambiguous : int
        Of the same place, refused: with degenerate directions, those of them with an error
        outside 3 sigma, with alternatives.
    accepted, strange_degenerate, strange_ambiguous : int
        Of different places: with `success`, and refused likewise.
    nees_mean, nees_within : float
        Over the right ones that are kept: mean, and share within 3 sigma; NaN without any.
    """

    same: int
    right_kept: int
    right_refused: int
    wrong_accepted: int
    degenerate: int
    outside: int
    ambiguous: int
    different: int
    accepted: int
    strange_degenerate: int
    strange_ambiguous: int
    nees_mean: float
    nees_within: float

    @property
    def wrong(self) -> int:
        """Pairs about which something wrong was claimed."""
        return self.wrong_accepted + self.outside + self.accepted


def count(rows: Sequence[Row]) -> Count:
    """Count what became of pairs."""
    same, different = ([row for row in rows if row.right is right] for right in (True, False))
    slid = [row for row in same if _degenerate(row)]
    nees = np.array([row.nees for row in same if row.success and not np.isnan(row.nees)])
    return Count(
        len(same), sum(row.success for row in same),
        sum(row.within and not row.valid for row in same), sum(row.false_accept for row in same),
        # without a covariance nothing holds the error
        len(slid), sum(not row.nees <= THREE_SIGMA for row in slid),
        sum(_ambiguous(row) for row in same),
        len(different), sum(row.false_accept for row in different),
        sum(_degenerate(row) for row in different), sum(_ambiguous(row) for row in different),
        float(nees.mean()) if len(nees) else float('nan'),
        float(np.mean(nees <= THREE_SIGMA)) if len(nees) else float('nan'))


def _degenerate(row: Row) -> bool:
    return not row.valid and row.degenerate > 0


def _ambiguous(row: Row) -> bool:
    return not row.valid and row.alternatives > 0


def trust_table(rows: Sequence[Row], methods: Sequence[str], repeating: Collection[str] = ()
                ) -> str:
    """Return what became of pairs, by data set or kind of place.

    Parameters
    ----------
    rows : sequence of Row
    methods : sequence of str
        Which of them.
    repeating : collection of str
        Data sets whose places repeat themselves, so that no answer can be the only one.
    """
    lines = []
    for data_set in dict.fromkeys(row.data_set for row in rows):
        mark = ' (repeats)' if data_set in repeating else ''
        lines += [_line(f'{data_set}{mark}: {name}', [
            row for row in rows if (row.method, row.data_set) == (name, data_set)])
            for name in methods]
    lines += [_line(f'**all**: {name}', [row for row in rows if row.method == name])
              for name in methods]
    return markdown(
        ['kind: method', 'same place', 'right, kept', 'right, refused', 'wrong, accepted',
         'degenerate', 'of those outside 3 sigma', 'ambiguous', 'different places', 'accepted',
         'degenerate', 'ambiguous', 'NEES', 'within 3 sigma'], lines)


def _line(name: str, rows: Sequence[Row]) -> list[str]:
    found = count(rows)
    same = [str(number) if found.same else '-' for number in (
        found.right_kept, found.right_refused, found.wrong_accepted, found.degenerate,
        found.outside, found.ambiguous)]
    different = [str(number) if found.different else '-' for number in (
        found.accepted, found.strange_degenerate, found.strange_ambiguous)]
    nees = (['-', '-'] if np.isnan(found.nees_mean)
            else [f'{found.nees_mean:.3g}', f'{100 * found.nees_within:.0f} %'])
    return [name, str(found.same), *same, str(found.different), *different, *nees]


def verdicts(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Return in a sentence for each method how often something wrong was claimed."""
    lines = []
    for name in methods:
        own = [row for row in rows if row.method == name]
        found = count(own)
        lines.append(
            f'{name}: wrong {found.wrong} of {len(own)} ({found.wrong_accepted} wrong answers and '
            f'{found.accepted} pairs of different places accepted, {found.outside} degenerate '
            'outside 3 sigma).')
    return '\n'.join(lines)


@dataclass(frozen=True)
class Bin:
    """Answers of like confidence.

    Attributes
    ----------
    low, high : float
        Bounds of the confidence.
    answers : int
    mean : float
        Their mean confidence.
    right : int
        How many of them are right.
    """

    low: float
    high: float
    answers: int
    mean: float
    right: int


def reliability(rows: Sequence[Row]) -> list[Bin]:
    """Sort all candidates, refused ones too, by confidence; bins without any are left out."""
    known = [row for row in rows if not np.isnan(row.confidence)]
    confidence = np.array([row.confidence for row in known])
    right = np.array([row.right and row.within for row in known], bool)
    where = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    return [Bin(BINS[i], BINS[i + 1], int(own.sum()), float(confidence[own].mean()),
                int(right[own].sum()))
            for i in range(len(BINS) - 1) if (own := where == i).any()]


def reliability_table(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Return, by bin of confidence, how many answers there are and how many of them are right."""
    bins = {name: {each.low: each for each in reliability(
        [row for row in rows if row.method == name])} for name in methods}
    lines = []
    for low, high in pairwise(BINS):
        cells = [f'{100 * own.right / own.answers:.0f} % of {own.answers}' if own else '-'
                 for own in (bins[name].get(low) for name in methods)]
        lines.append([f'{low:g}-{high:g}', *cells])
    return markdown(['confidence', *(f'{name}: right' for name in methods)], lines)
