"""Calibration: what a pose score is worth, as the probability that the pose is right.

A logistic model of two numbers that a person can follow. `sgor_benchmark calibrate` fits it again;
docs/trust.md tells on which sensors and places it was fitted, and how far off the probability is
on those that were left out.
"""
import math

INTERCEPT, OVERLAP, VIOLATIONS = -8.34, 2.85, -3.34
"""Coefficients of one, of the logarithm of the share of keypoints that agrees, and of the
logarithm of the share that violates free space."""
FEWEST_VIOLATIONS = 0.005
"""Added to the share that violates: none at all may be chance."""


def probability(overlap: float, violations: float) -> float:
    """Return the probability that a pose is right where no other competes with it, 0 to 1.

    Parameters
    ----------
    overlap, violations : float
        Shares of the keypoints, as in `PoseScore`.
    """
    if overlap <= 0:
        return 0.0
    value = (INTERCEPT + OVERLAP * math.log(overlap)
             + VIOLATIONS * math.log(violations + FEWEST_VIOLATIONS))
    return 1.0 / (1.0 + math.exp(-value))
