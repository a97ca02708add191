"""Reliability diagram: the share of answers that is right against their confidence."""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .row import Row

BINS = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0)
"""Of confidence; finer where it matters."""


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
    """Sort all answers, refused ones too, by confidence; bins without any are left out."""
    known = [row for row in rows if not np.isnan(row.confidence)]
    return binned(np.array([row.confidence for row in known]),
                  np.array([row.right and row.within for row in known], bool), BINS)


def binned(confidence: NDArray[np.float64], right: NDArray[np.bool_], edges: Sequence[float]
           ) -> list[Bin]:
    """Sort (N,) answers by confidence; bins without any are left out."""
    where = np.clip(np.digitize(confidence, edges) - 1, 0, len(edges) - 2)
    return [Bin(edges[i], edges[i + 1], int(own.sum()), float(confidence[own].mean()),
                int(right[own].sum()))
            for i in range(len(edges) - 1) if (own := where == i).any()]
