"""How far verdicts and confidence can be trusted: outcomes, and the reliability diagram."""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..rows import Row
from .consistency import NEES_BOUND

BINS = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0)
"""Of confidence; finer where it matters."""


@dataclass(frozen=True)
class Outcomes:
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


def outcomes(rows: Sequence[Row]) -> Outcomes:
    """Count what became of pairs."""
    same, different = ([row for row in rows if row.same_place is same] for same in (True, False))
    degenerate = [row for row in same if _degenerate(row)]
    nees = np.array([row.nees for row in same if row.success and not np.isnan(row.nees)])
    return Outcomes(
        len(same), sum(row.success for row in same),
        sum(row.correct and not row.accepted for row in same),
        sum(row.false_accept for row in same),
        # without a covariance nothing holds the error
        len(degenerate), sum(not row.nees <= NEES_BOUND for row in degenerate),
        sum(_ambiguous(row) for row in same),
        len(different), sum(row.false_accept for row in different),
        sum(_degenerate(row) for row in different), sum(_ambiguous(row) for row in different),
        float(nees.mean()) if len(nees) else float('nan'),
        float(np.mean(nees <= NEES_BOUND)) if len(nees) else float('nan'))


def _degenerate(row: Row) -> bool:
    return not row.accepted and row.degenerate > 0


def _ambiguous(row: Row) -> bool:
    return not row.accepted and row.alternatives > 0


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


def reliability_diagram(rows: Sequence[Row]) -> list[Bin]:
    """Sort all candidates, refused ones too, by confidence; bins without any are left out."""
    known = [row for row in rows if not np.isnan(row.confidence)]
    confidence = np.array([row.confidence for row in known])
    right = np.array([row.same_place and row.correct for row in known], bool)
    where = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    return [Bin(BINS[i], BINS[i + 1], int(own.sum()), float(confidence[own].mean()),
                int(right[own].sum()))
            for i in range(len(BINS) - 1) if (own := where == i).any()]
