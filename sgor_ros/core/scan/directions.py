"""The directions that a sensor looks in: the returns of a scan in cells of one degree."""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.angles import atan2
from ..execution.threads import parallel_for

AZIMUTHS, ELEVATIONS = 360, 180
"""Cells around and from below to above: 1 degree, wider than the gaps between most beams."""
AROUND, UP_AND_DOWN = np.float32(1 / (2 * math.pi)), np.float32(1 / math.pi)
HALF = np.float32(0.5)


@dataclass(frozen=True, eq=False)
class Rays:
    """The returns of a scan, sorted by the cell that they are seen in.

    Attributes
    ----------
    order : (N,) int32
        Which return comes where.
    ranges : (N,) float32
        Metres, in that order.
    first : (AZIMUTHS * ELEVATIONS + 1,) int32
        Cell c, azimuth by azimuth, holds the returns ``first[c]`` to ``first[c + 1] - 1``.
    """

    order: NDArray[np.int32]
    ranges: NDArray[np.float32]
    first: NDArray[np.int32]


def by_direction(points: NDArray[np.float32]) -> Rays:
    """Sort (N, 3) points, metres from the sensor, by the direction that they are seen in."""
    return Rays(*_sorted(*cells_and_ranges(points), AZIMUTHS * ELEVATIONS))


def cells_and_ranges(points: NDArray[np.float32]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the cell that each of (N, 3) points is seen in, and how far it is, metres."""
    cells = np.empty(len(points), np.int32)
    ranges = np.empty(len(points), np.float32)
    parallel_for(_look, len(points), points, cells, ranges)
    return cells, ranges


@numba.njit(cache=True, nogil=True, inline='always')
def direction(x, y, z):
    """Return the cell, by azimuth and elevation, that a point is seen in."""
    azimuth = np.int32((atan2(y, x) * AROUND + HALF) * np.float32(AZIMUTHS))
    elevation = np.int32((atan2(z, math.sqrt(x * x + y * y)) * UP_AND_DOWN + HALF)
                         * np.float32(ELEVATIONS))
    return (min(max(azimuth, np.int32(0)), np.int32(AZIMUTHS - 1)),
            min(max(elevation, np.int32(0)), np.int32(ELEVATIONS - 1)))


# vector instructions need float32 throughout, a loop over a whole array, division without a check
@numba.njit(cache=True, nogil=True, error_model='numpy', fastmath={'nsz', 'nnan', 'contract'})
def _look(begin, end, points, cells, ranges):
    points, cells, ranges = points[begin:end], cells[begin:end], ranges[begin:end]
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        azimuth, elevation = direction(x, y, z)
        cells[i] = azimuth * ELEVATIONS + elevation
        ranges[i] = math.sqrt(x * x + y * y + z * z)


@numba.njit(cache=True, nogil=True)
def _sorted(cells, ranges, count):
    first = np.zeros(count + 1, np.int32)
    for cell in cells:
        first[cell + 1] += 1
    for cell in range(count):
        first[cell + 1] += first[cell]
    order = np.empty(len(cells), np.int32)
    in_order = np.empty(len(cells), np.float32)
    at = first[:-1].copy()
    for i in range(len(cells)):
        order[at[cells[i]]] = i
        in_order[at[cells[i]]] = ranges[i]
        at[cells[i]] += 1
    return order, in_order, first
