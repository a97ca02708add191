"""Degeneracy: directions in which the clouds slide on each other (localizability).

Normals of surfaces that face no way along a direction cannot hold it (the eigenvalues of the
point-to-plane information, as in Zhang 2016 and X-ICP). Noise of the normals blurs the smallest of
them, so a weak direction is tried: the source is pushed along it, fitted again, and the direction
is free where the clouds neither slide back nor mind. How far they can be pushed is how little is
known.
"""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common import se3
from .icp import partners
from .view import View

SAMPLE = 1000
"""Keypoints behind the information matrix."""
WEAK = 0.1
"""A direction is tried when less than this share of the points, so to say, faces along it."""
LEVEL = 0.3
"""Share of the information that a ground plane seen by both scans adds to height, roll and pitch:
the keypoints are none of the ground."""
PUSH, PUSHES = 2.0, (4.0, 16.0)
"""How far a weak direction is tried, in reaches of the views: the first decides, the others tell
how far it goes on, and where to."""

CROOKED = 0.01
"""What is slid along is straight to this share of the way: so far off may the rest be."""
INDEPENDENT = 0.1
"""Sine of the least angle between a direction and the span of those before it."""


@dataclass(frozen=True, eq=False)
class Slide:
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

    twist: NDArray[np.float64]
    sigma: float
    lever: float


def information(source: View, target: View, T_target_source: NDArray[np.float64]
                ) -> tuple[NDArray[np.float64], float]:
    """Return the point-to-plane information matrix of a placement and the typical lever.

    Returns
    -------
    (6, 6) float64
        Mean over the points that lie on a surface; (x, y, z, rotation about x, y, z) about the
        source's sensor in the target frame, rotations times the lever, so that all are metres.
    float
        Root mean square distance of the points from the sensor, metres.
    """
    rows, at = partners(source, target, T_target_source, SAMPLE)
    if not len(rows):
        return np.zeros((6, 6)), 1.0
    arms = source.points[rows] @ T_target_source[:3, :3].T
    lever = float(np.sqrt((arms**2).sum(axis=1).mean()))
    normals = target.normals[at]
    jacobian = np.hstack((normals, np.cross(arms, normals) / lever))
    matrix = jacobian.T @ jacobian / len(rows)
    if source.level and target.level:
        x, y, up = target.axes
        for direction in (np.r_[up, 0, 0, 0], np.r_[0, 0, 0, x], np.r_[0, 0, 0, y]):
            matrix += LEVEL * np.outer(direction, direction)
    return matrix, lever


def weak_directions(source: View, target: View, T_target_source: NDArray[np.float64]
                    ) -> tuple[NDArray[np.float64], float]:
    """Return twists (K, 6) of one metre along which the surfaces hold little, and the lever."""
    matrix, lever = information(source, target, T_target_source)
    values, vectors = np.linalg.eigh(matrix)
    twists = vectors[:, values < WEAK].T
    twists[:, 3:] /= lever
    return twists, lever


def is_shift(twist: NDArray[np.float64]) -> bool:
    """Return whether a twist of one metre is more of a shift than of a turn."""
    return bool(np.linalg.norm(twist[:3]) > np.sqrt(0.5))


def pushed(T_target_source: NDArray[np.float64], twists: NDArray[np.float64]
           ) -> NDArray[np.float64]:
    """Move a placement by (K, 6) twists about its own origin, (K, 4, 4)."""
    moved = np.tile(T_target_source, (len(twists), 1, 1))
    moved[:, :3, :3] = se3.rotations(twists[:, 3:]) @ T_target_source[:3, :3]
    moved[:, :3, 3] += twists[:, :3]
    return moved


def without_slides(T: NDArray[np.float64], other: NDArray[np.float64], slides: tuple[Slide, ...]
                   ) -> NDArray[np.float64]:
    """Slide `other` back towards T as far as the free directions let it, (4, 4)."""
    for slide in slides:
        gap = se3.perturbation(T, other)
        # a slide is a translation or a turn; the other part is a by-product
        part = slice(0, 3) if is_shift(slide.twist) else slice(3, 6)
        length = gap[part] @ slide.twist[part] / (slide.twist[part] @ slide.twist[part])
        other = pushed(other, length * slide.twist[None])[0]
    return other


def inflate(covariance: NDArray[np.float64], slides: tuple[Slide, ...]) -> NDArray[np.float64]:
    """Add what is unknown along the slides to a (6, 6) covariance."""
    for slide in slides:
        covariance = covariance + slide.sigma**2 * np.outer(slide.twist, slide.twist)
        aside = CROOKED * slide.sigma * np.repeat((1.0, 1.0 / slide.lever), 3)
        covariance = covariance + np.diag(aside**2)
    return covariance


def directions(slides: tuple[Slide, ...]) -> NDArray[np.float64]:
    """Return the slides as unit directions, (K, 6), without those that lie in the span of others.

    Three shifts may have been laid into one plane, the ground; two may have ended as the same.
    """
    kept: list[NDArray[np.float64]] = []
    span = np.empty((0, 6))    # orthonormal, rotations as metres at the lever
    for slide in slides:
        metric = slide.twist * np.repeat((1.0, slide.lever), 3)
        metric = metric / np.linalg.norm(metric)
        beyond = metric - span.T @ (span @ metric)
        if np.linalg.norm(beyond) < INDEPENDENT:
            continue
        span = np.vstack((span, beyond / np.linalg.norm(beyond)))
        kept.append(slide.twist / np.linalg.norm(slide.twist))
    return np.array(kept).reshape(-1, 6)


def in_words(slides: tuple[Slide, ...]) -> str:
    """Say in words how the clouds slide."""
    said = []
    for slide in slides:
        if is_shift(slide.twist):
            x, y, z = slide.twist[:3] / np.linalg.norm(slide.twist[:3])
            said.append(f'slide along ({x:.2f}, {y:.2f}, {z:.2f})')
        else:
            x, y, z = slide.twist[3:] / np.linalg.norm(slide.twist[3:])
            said.append(f'turn about ({x:.2f}, {y:.2f}, {z:.2f})')
    return 'degenerate: the clouds ' + ' and '.join(said)
