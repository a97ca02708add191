"""The calibration of the confidence: a logistic model, fitted and checked on what it left out."""
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.scoring.calibration import FEWEST_VIOLATIONS
from .metrics.reliability import binned

Array = NDArray[np.float64]

BINS = tuple(k / 10 for k in range(11))
"""Of the expected calibration error."""
SURE = 0.99
"""Claims from here on are counted by themselves."""


@dataclass(frozen=True)
class Sample:
    """One registration: its pose score, and whether it is right.

    Attributes
    ----------
    overlap, violations : float
        As in `PoseScore`.
    right : bool
    sensor, place, labels : str
        What it was made with.
    """

    overlap: float
    violations: float
    right: bool
    sensor: str
    place: str
    labels: str


@dataclass(frozen=True)
class Model:
    """Intercept and coefficients of the logarithms: overlap, violations."""

    intercept: float
    coefficients: tuple[float, float]

    def probabilities(self, samples: Sequence[Sample]) -> Array:
        """Return the probability that each is right, (N,)."""
        value: Array = self.intercept + features(samples) @ np.array(self.coefficients)
        return 1 / (1 + np.exp(-value))


@dataclass(frozen=True)
class Quality:
    """How good probabilities are.

    Attributes
    ----------
    samples, right : int
    calibration_error : float
        Expected calibration error: mean distance of what is claimed from what is right, over bins
        of the claim.
    brier : float
        Mean square of claim less outcome.
    sure, sure_wrong : int
        Claims of `SURE` and more, and how many of them are wrong.
    """

    samples: int
    right: int
    calibration_error: float
    brier: float
    sure: int
    sure_wrong: int


def features(samples: Sequence[Sample]) -> Array:
    """Return the logarithms that the model weighs, (N, 2)."""
    overlap, violations = np.array([(s.overlap, s.violations) for s in samples],
                                   float).reshape(-1, 2).T
    return np.log(np.column_stack((np.maximum(overlap, 1e-4), violations + FEWEST_VIOLATIONS)))


def fit(samples: Sequence[Sample]) -> Model:
    """Fit the logistic model; needs scikit-learn.

    Raises
    ------
    InputError
        All of them are right, or none.
    """
    right = sum(s.right for s in samples)
    if right in (0, len(samples)):
        raise InputError(f'{right} of {len(samples)} answers are right: nothing to tell them '
                         'apart by; take more of them')
    from sklearn.linear_model import LogisticRegression
    values = features(samples)
    mean, spread = values.mean(axis=0), values.std(axis=0) + 1e-9
    model = LogisticRegression(C=1.0).fit((values - mean) / spread, [s.right for s in samples])
    weights = model.coef_[0] / spread
    return Model(float(model.intercept_[0] - weights @ mean),
                 (float(weights[0]), float(weights[1])))


def left_out(samples: Sequence[Sample], group: str) -> Array:
    """Return the probability of each by a model that has seen none of its group, (N,).

    Parameters
    ----------
    samples : sequence of Sample
    group : str
        'sensor' or 'place'.
    """
    names = np.array([getattr(s, group) for s in samples])
    claimed = np.zeros(len(samples))
    for name in np.unique(names):
        others = [s for s, own in zip(samples, names == name, strict=True) if not own]
        own = [s for s, own in zip(samples, names == name, strict=True) if own]
        claimed[names == name] = fit(others).probabilities(own)
    return claimed


def quality(claimed: Array, right: NDArray[np.bool_]) -> Quality:
    """Compare (N,) probabilities with what came of them."""
    error = sum(abs(each.answers * each.mean - each.right)
                for each in binned(claimed, right, BINS)) / max(len(claimed), 1)
    sure = claimed >= SURE
    return Quality(len(claimed), int(right.sum()), error,
                   float(np.mean((claimed - right)**2)) if len(claimed) else 0.0,
                   int(sure.sum()), int((sure & ~right).sum()))
