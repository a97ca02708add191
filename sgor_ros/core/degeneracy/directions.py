"""Degenerate directions, and what they mean for poses, covariances and readers."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common import se3

Array = NDArray[np.float64]

CROOKED = 0.01
"""What is slid along is straight to this share of the way: so far off may the rest be."""
INDEPENDENT = 0.1
"""Sine of the least angle between a direction and the span of those before it."""


@dataclass(frozen=True, eq=False)
class DegenerateDirection:
    """A direction in which the clouds slide.

    Attributes
    ----------
    twist : (6,) float64
        (x, y, z, rotation about x, y, z) about the sensor in the target frame, of a slide by one
        metre at the typical point.
    sigma : float
        How far, metres: what is really unknown.
    lever : float
        Typical distance of the points from the sensor, metres.
    """

    twist: Array
    sigma: float
    lever: float


def is_shift(twist: Array) -> bool:
    """Return whether a twist of one metre is more of a shift than of a turn."""
    return bool(np.linalg.norm(twist[:3]) > np.sqrt(0.5))


def perturbed_poses(T_target_source: Array, twists: Array) -> Array:
    """Move a pose by (K, 6) twists about its own origin, (K, 4, 4)."""
    moved = np.tile(T_target_source, (len(twists), 1, 1))
    moved[:, :3, :3] = se3.rotations(twists[:, 3:]) @ T_target_source[:3, :3]
    moved[:, :3, 3] += twists[:, :3]
    return moved


def slid_back(T: Array, other: Array, degenerate: tuple[DegenerateDirection, ...]) -> Array:
    """Slide `other` back towards T as far as the degenerate directions let it, (4, 4)."""
    for direction in degenerate:
        twist, gap = direction.twist, se3.perturbation(T, other)
        # a slide is a translation or a turn; the other part is a by-product
        part = slice(0, 3) if is_shift(twist) else slice(3, 6)
        length = gap[part] @ twist[part] / (twist[part] @ twist[part])
        other = perturbed_poses(other, length * twist[None])[0]
    return other


def inflated(covariance: Array, degenerate: tuple[DegenerateDirection, ...]) -> Array:
    """Add what is unknown along the degenerate directions to a (6, 6) covariance."""
    for direction in degenerate:
        twist, sigma = direction.twist, direction.sigma
        covariance = covariance + sigma**2 * np.outer(twist, twist)
        aside = CROOKED * sigma * np.repeat((1.0, 1.0 / direction.lever), 3)
        covariance = covariance + np.diag(aside**2)
    return covariance


def independent(degenerate: tuple[DegenerateDirection, ...]) -> Array:
    """Return unit directions, (K, 6), without those that lie in the span of others.

    Three shifts may have been laid into one plane, the ground; two may have ended as the same.
    """
    kept: list[Array] = []
    span = np.empty((0, 6))    # orthonormal, rotations as metres at the lever
    for direction in degenerate:
        metric = direction.twist * np.repeat((1.0, direction.lever), 3)
        metric = metric / np.linalg.norm(metric)
        beyond = metric - span.T @ (span @ metric)
        if np.linalg.norm(beyond) < INDEPENDENT:
            continue
        span = np.vstack((span, beyond / np.linalg.norm(beyond)))
        kept.append(direction.twist / np.linalg.norm(direction.twist))
    return np.array(kept).reshape(-1, 6)


def in_words(degenerate: tuple[DegenerateDirection, ...]) -> str:
    """Describe the directions for a person."""
    parts = []
    for direction in degenerate:
        part, way = ((slice(0, 3), 'slide along') if is_shift(direction.twist)
                     else (slice(3, 6), 'turn about'))
        x, y, z = direction.twist[part] / np.linalg.norm(direction.twist[part])
        parts.append(f'{way} ({x:.2f}, {y:.2f}, {z:.2f})')
    return 'degenerate: the clouds ' + ' and '.join(parts)
