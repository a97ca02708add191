"""What may be wrong with scans in words: not in metres, not in the sensor frame, of two sizes.

Hints judge nothing; they go with the warnings (beyond the paper).
"""
import math

import numpy as np
from numpy.typing import NDArray

from ..common.products import times_transposed
from ..config import SgorConfig
from .result import Registration

CELL = 4.0
"""Metres: the ground is compared in squares of this."""
OFF_CENTRE = 14.0
"""Metres from the origin to the densest square: of some 190 real scans at most 12.6 (8 but for one
with trees), and of the same ones moved by 20 m at least 16 but for one."""
FARTHEST_MEDIAN = 500.0
"""Metres: no LiDAR measures half of its points beyond."""
FEW = 100
SAMPLE = 20000

SCALE_OFF = 0.01
"""Share that lengths may differ by unsaid: right pairs of real scans are told to differ by at most
0.003, the same with one scan made larger by 0.02 by at least 0.016."""
SCALE_SIGMAS = 5.0
SCALE_ROUNDS = 5
SCALE_MATCHES = 30
SCALE_CONFIDENCE = 0.05
"""Below, the transformation is probably another anyway."""


def frame_hint(points: NDArray[np.float32], config: SgorConfig) -> str:
    """Say why (N, 3) points, relative to the sensor, may be no metres; empty: they may be.

    The origin of a scan is the sensor, and a sensor sees most of what is next to it.
    """
    points = points[::max(len(points) // SAMPLE, 1)]
    squared = np.einsum('ij,ij->i', points, points, dtype=np.float64)
    nearest, median = math.sqrt(squared.min()), math.sqrt(np.median(squared))
    around = float(np.linalg.norm(points.mean(axis=0, dtype=np.float64))) < median / 2
    if median > FARTHEST_MEDIAN and around:
        return (f'half of the points are farther than {median:.0f} m from the origin: are they in '
                'metres, not in millimetres?')
    if nearest > config.max_range:
        return (f'the nearest point is {nearest:.0f} m from the origin, beyond max_range '
                f'({config.max_range:g} m): is it in the frame of the sensor, not of a map?')
    near = points[(squared <= config.max_range**2) & (squared >= config.min_range**2)]
    if not len(near):
        return (f'no point is between min_range ({config.min_range:g} m) and max_range '
                f'({config.max_range:g} m); the farthest is {math.sqrt(squared.max()):.2g} m from '
                'the origin: are they in metres?')
    squares = np.rint(near[:, :2] / CELL).astype(np.int32)
    places, counts = np.unique(squares, axis=0, return_counts=True)
    centre = float(np.linalg.norm(places[counts.argmax()])) * CELL
    if centre > OFF_CENTRE and len(near) > FEW:
        return (f'most points are {centre:.0f} m from the origin: is it in the frame of the '
                'sensor? The origin is taken for the sensor')
    return ''


def scale_hint(result: Registration, config: SgorConfig) -> str:
    """Say that one of two registered scans seems the larger; empty: they seem alike.

    The matches are fitted by a similarity that keeps the rotation, in rounds, for those farther
    out agree with it only when it has the right factor.
    """
    if result.T_target_source is None or result.confidence < SCALE_CONFIDENCE:
        return ''
    turned = times_transposed(result.source_points, result.T_target_source[:3, :3])
    target, agree, factor = result.target_points, result.inliers, 1.0
    for _ in range(SCALE_ROUNDS):
        if agree.sum() < SCALE_MATCHES:
            return ''
        p, q = turned[agree], target[agree]
        p_mean, q_mean = p.mean(axis=0), q.mean(axis=0)
        spread = float(((p - p_mean)**2).sum())
        factor = float(((p - p_mean) * (q - q_mean)).sum()) / max(spread, 1e-9)
        gaps = turned * factor + (q_mean - factor * p_mean) - target
        squared = np.einsum('ij,ij->i', gaps, gaps)
        agree = squared < config.tau_1**2
    sigma = math.sqrt(float(squared[agree].mean()) / 3 / max(spread, 1e-9)) if agree.any() else 1.0
    if abs(factor - 1) < max(SCALE_OFF, SCALE_SIGMAS * sigma):
        return ''
    return (f'by the matches, lengths in the source are {1 / factor:.3f} times those in the '
            'target: are both in metres?')
