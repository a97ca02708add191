"""Registration recall (RR), and what else becomes of pairs: refused, degenerate, accepted wrongly.

RR is the share of pairs whose answer is within the threshold on RE and TE and not refused.
"""
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .pose_error import NEES_BOUND
from .row import Row
from .row import Threshold

EASY = Threshold('easy', 5.0, 0.6)
"""The strict thresholds of the literature on KITTI."""
MEDIUM = Threshold('medium', 5.0, 0.3)
HARD = Threshold('hard', 2.0, 0.1)
LOOPS = Threshold('5 deg, 2 m', 5.0, 2.0)
INDOOR = Threshold('15 deg, 30 cm', 15.0, 0.3)

NEAR_M = 20.0


def registration_recall(rows: Sequence[Row]) -> float:
    """Return RR, 0 to 1; NaN of no rows."""
    return sum(row.success for row in rows) / len(rows) if rows else float('nan')


@dataclass(frozen=True)
class Outcomes:
    """What became of some pairs; all but the last two are numbers of pairs.

    Attributes
    ----------
    same, different : int
        Pairs of the same place, pairs of different places.
    right_kept, right_refused, wrong_accepted : int
        Of the same place: right answers with and without `success`, wrong ones with it.
    degenerate, outside, ambiguous : int
        Of the same place, refused: with degenerate directions, those of them with an error
        outside 3 sigma, with alternatives.
    accepted, different_degenerate, different_ambiguous : int
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
    different_degenerate: int
    different_ambiguous: int
    nees_mean: float
    nees_within: float

    @property
    def wrong(self) -> int:
        """Pairs about which something wrong was claimed."""
        return self.wrong_accepted + self.outside + self.accepted


def outcomes(rows: Iterable[Row]) -> Outcomes:
    """Count what became of pairs."""
    rows = list(rows)
    same, different = ([row for row in rows if row.right is right] for right in (True, False))
    degenerate = [row for row in same if _degenerate(row)]
    nees = np.array([row.nees for row in same if row.success and not np.isnan(row.nees)])
    return Outcomes(
        len(same), sum(row.success for row in same),
        sum(row.within and not row.valid for row in same), sum(row.false_accept for row in same),
        # without a covariance nothing holds the error
        len(degenerate), sum(not row.nees <= NEES_BOUND for row in degenerate),
        sum(_ambiguous(row) for row in same),
        len(different), sum(row.false_accept for row in different),
        sum(_degenerate(row) for row in different), sum(_ambiguous(row) for row in different),
        float(nees.mean()) if len(nees) else float('nan'),
        float(np.mean(nees <= NEES_BOUND)) if len(nees) else float('nan'))


def _degenerate(row: Row) -> bool:
    return not row.valid and row.degenerate > 0


def _ambiguous(row: Row) -> bool:
    return not row.valid and row.alternatives > 0


def at_threshold(rows: Sequence[Row], threshold: float) -> tuple[NDArray[np.bool_], ...]:
    """Tell for each answer of four kinds whether a threshold would get it wrong.

    Returns
    -------
    tuple of (K,) bool
        Right answers refused; of pairs within 20 m; wrong answers to right pairs accepted; wrong
        pairs accepted.
    """
    right = [row for row in rows if row.right and row.within]
    near = [row for row in right if row.distance_m <= NEAR_M]
    bad = [row for row in rows if row.right and not row.within]
    wrong = [row for row in rows if not row.right and not row.within]
    return (*(np.array([row.score < threshold for row in part], bool) for part in (right, near)),
            *(np.array([row.score >= threshold for row in part], bool) for part in (bad, wrong)))
