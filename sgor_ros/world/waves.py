"""Undulating land: a sum of sine waves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def draw_waves(rng: np.random.Generator, count: int, length: tuple[float, float],
               amplitude: float) -> Array:
    """Draw waves of any direction.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of chance.
    count : int
        How many.
    length : tuple of float
        Least and greatest wave length, m.
    amplitude : float
        The greatest amplitude of one, m.

    Returns
    -------
    (count, 4) array
        Rows of wave vector (rad/m, two), phase (rad), amplitude (m).
    """
    direction = rng.uniform(0.0, 2 * np.pi, count)
    number = 2 * np.pi / rng.uniform(*length, count)
    return np.column_stack([
        number * np.cos(direction),
        number * np.sin(direction),
        rng.uniform(0.0, 2 * np.pi, count),
        amplitude * rng.uniform(0.4, 1.0, count),
    ])


def wave_sum(waves: Array, xy: Array) -> Array:
    """Height (N,), m, of waves (K, 4) at points (N, 2), m."""
    total = np.zeros(len(xy))
    for kx, ky, phase, amplitude in waves:
        total += amplitude * np.sin(kx * xy[:, 0] + ky * xy[:, 1] + phase)
    return total
