"""What becomes of pairs, by kind of place: kept, refused, degenerate, ambiguous, wrong."""
from collections.abc import Collection
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..metrics.pose_error import NEES_BOUND
from ..metrics.registration_recall import outcomes
from ..metrics.reliability import BINS
from ..metrics.reliability import reliability_diagram
from ..metrics.row import Row
from .tables import markdown

RULE = ('Right: within 5 deg and 60 cm. Kept: with `success`; all others are refused. Degenerate '
        'and ambiguous: refused because the clouds slide on each other, or because several '
        'placements explain them. Outside 3 sigma: degenerate, with an error whose NEES is over '
        f'{NEES_BOUND:.1f} (chi-square of 6 dimensions, 99.73 %). NEES: mean over what is right '
        'and kept, 6 where the covariance is right, and the share of it up to that bound.')


def outcome_table(rows: Sequence[Row], methods: Sequence[str], repeating: Collection[str] = ()
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
    found = outcomes(rows)
    same = [str(number) if found.same else '-' for number in (
        found.right_kept, found.right_refused, found.wrong_accepted, found.degenerate,
        found.outside, found.ambiguous)]
    different = [str(number) if found.different else '-' for number in (
        found.accepted, found.different_degenerate, found.different_ambiguous)]
    nees = (['-', '-'] if np.isnan(found.nees_mean)
            else [f'{found.nees_mean:.3g}', f'{100 * found.nees_within:.0f} %'])
    return [name, str(found.same), *same, str(found.different), *different, *nees]


def wrong_claims(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Return in a sentence for each method how often something wrong was claimed."""
    lines = []
    for name in methods:
        own = [row for row in rows if row.method == name]
        found = outcomes(own)
        lines.append(
            f'{name}: wrong {found.wrong} of {len(own)} ({found.wrong_accepted} wrong answers and '
            f'{found.accepted} pairs of different places accepted, {found.outside} degenerate '
            'outside 3 sigma).')
    return '\n'.join(lines)


def reliability_table(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Return, by bin of confidence, how many answers there are and how many of them are right."""
    bins = {name: {each.low: each for each in reliability_diagram(
        [row for row in rows if row.method == name])} for name in methods}
    lines = []
    for low, high in pairwise(BINS):
        cells = [f'{100 * own.right / own.answers:.0f} % of {own.answers}' if own else '-'
                 for own in (bins[name].get(low) for name in methods)]
        lines.append([f'{low:g}-{high:g}', *cells])
    return markdown(['confidence', *(f'{name}: right' for name in methods)], lines)
