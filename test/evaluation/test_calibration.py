"""The confidence as a probability: its formula, its fit, and how far off it is."""
import math

import numpy as np
import pytest

from sgor_ros.core.common.settings import InputError
from sgor_ros.core.scoring.calibration import probability
from sgor_ros.evaluation.calibration import fit
from sgor_ros.evaluation.calibration import left_out
from sgor_ros.evaluation.calibration import quality
from sgor_ros.evaluation.calibration import Sample


def drawn(count, intercept, weights, seed=0):
    """Return samples that are right with the probability of a known model; three sensors."""
    rng = np.random.default_rng(seed)
    samples = []
    for k in range(count):
        overlap, violations = rng.uniform(0.02, 1.0), rng.uniform(0.0, 0.2)
        value = (intercept + weights[0] * math.log(overlap)
                 + weights[1] * math.log(violations + 0.005))
        samples.append(Sample(overlap, violations, bool(rng.random() < 1 / (1 + math.exp(-value))),
                              f's{k % 3}', 'street', 'none'))
    return samples


def test_the_probability_by_hand():
    """Odds of exp(-8.34) overlap^2.85 (violations + 0.005)^-3.34."""
    odds = math.exp(-8.34) * 0.5**2.85 * 0.015**-3.34
    assert probability(0.5, 0.01) == pytest.approx(odds / (1 + odds))
    assert probability(0.0, 0.0) == 0.0


def test_more_overlap_and_fewer_violations_are_more_probable():
    shares = np.linspace(0.01, 1.0, 50)
    assert (np.diff([probability(share, 0.05) for share in shares]) > 0).all()
    assert (np.diff([probability(0.3, share) for share in shares]) < 0).all()


def test_the_fit_finds_the_model_that_drew_the_answers():
    pytest.importorskip('sklearn')
    model = fit(drawn(20000, -6.0, (2.0, -2.5)))
    assert model.intercept == pytest.approx(-6.0, abs=0.4)
    assert model.coefficients == pytest.approx((2.0, -2.5), abs=0.2)


def test_what_is_left_out_was_not_seen():
    """One sensor is right where the others are wrong: its claims are those of the others."""
    pytest.importorskip('sklearn')
    samples = drawn(1500, -6.0, (2.0, -2.5))
    flipped = [Sample(s.overlap, s.violations, s.right != (s.sensor == 's1'), s.sensor, s.place,
                      s.labels) for s in samples]
    own = np.array([s.sensor == 's1' for s in samples])
    claimed = left_out(flipped, 'sensor')
    np.testing.assert_allclose(claimed[own], left_out(samples, 'sensor')[own])
    right = np.array([s.right for s in flipped])
    assert quality(claimed[own], right[own]).calibration_error > 0.3


def test_quality_by_hand():
    """Bins 0.5 to 0.6: two claims of 0.55, one right; 0.9 to 1: 0.95 and 0.995, one right."""
    found = quality(np.array([0.55, 0.55, 0.95, 0.995]), np.array([True, False, True, False]))
    assert found.calibration_error == pytest.approx((abs(1.1 - 1) + abs(1.945 - 1)) / 4)
    assert found.brier == pytest.approx((0.45**2 + 0.55**2 + 0.05**2 + 0.995**2) / 4)
    assert (found.samples, found.right, found.sure, found.sure_wrong) == (4, 2, 1, 1)


def test_answers_that_are_all_right_cannot_be_fitted():
    with pytest.raises(InputError, match='2 of 2 answers are right'):
        fit([Sample(0.5, 0.0, True, 'a', 'b', 'none')] * 2)
