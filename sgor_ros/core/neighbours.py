"""Radius neighbours of all points of one cloud: one search for votes, normals and features."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

MAX_CELLS = 250_000
"""Bound on the search grid: beyond it empty cells would cost more than longer candidate lists."""


@dataclass(frozen=True)
class Neighbours:
    """Pairs of points nearer than a radius, in compressed rows.

    Attributes
    ----------
    start : (V + 1,) int64
        Row i holds the neighbours ``index[start[i]:start[i + 1]]``, the point itself first.
    index : (M,) int32
    squared : (M,) float32
        Squared distances, m^2.
    """

    start: NDArray[np.int64]
    index: NDArray[np.int32]
    squared: NDArray[np.float32]


def radius_neighbours(points: NDArray[np.float64], radius: float) -> Neighbours:
    """Find for every point all points of the same cloud within `radius` metres.

    Parameters
    ----------
    points : (V, 3) float64
    radius : float
        Metres.
    """
    if len(points) == 0:
        return Neighbours(np.zeros(1, np.int64), np.empty(0, np.int32), np.empty(0, np.float32))
    low = points.min(axis=0)
    extent = points.max(axis=0) - low
    cell = radius
    while np.prod(np.floor(extent / cell) + 3.0) > MAX_CELLS:
        cell *= 1.5
    # a border of empty cells on each side spares the bounds checks
    shape = np.floor(extent / cell).astype(np.int64) + 3
    x, y, z = np.floor((points - low) / cell).astype(np.int64).T + 1
    cells = (x * shape[1] + y) * shape[2] + z
    order = np.argsort(cells, kind='stable').astype(np.int32)
    first = np.zeros(np.prod(shape) + 1, np.int32)
    np.cumsum(np.bincount(cells, minlength=np.prod(shape)), out=first[1:])
    columns = np.ascontiguousarray(points[order].T)
    start = np.zeros(len(points) + 1, np.int64)
    _count(columns, cells[order], order, first, shape[1], shape[2], radius, start)
    np.cumsum(start, out=start)
    index = np.empty(start[-1], np.int32)
    squared = np.empty(start[-1], np.float32)
    _fill(columns, cells[order], order, first, shape[1], shape[2], radius, start, index, squared)
    return Neighbours(start, index, squared)


@numba.njit(cache=True, nogil=True, inline='always')
def _squared(columns, i, j):  # type: ignore[no-untyped-def]
    a = columns[0, j] - columns[0, i]
    b = columns[1, j] - columns[1, i]
    c = columns[2, j] - columns[2, i]
    return a * a + b * b + c * c


@numba.njit(cache=True, nogil=True, parallel=True)
def _count(columns, cells, order, first, ny, nz, radius, start):  # type: ignore[no-untyped-def]
    limit = radius * radius
    for at in numba.prange(len(order)):
        i = np.int64(at)
        found = 0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cells[i] + (dx * ny + dy) * nz
                for j in range(first[row - 1], first[row + 2]):
                    found += _squared(columns, i, j) <= limit
        start[order[i] + 1] = found


@numba.njit(cache=True, nogil=True, parallel=True)
def _fill(columns, cells, order, first, ny, nz, radius, start,  # type: ignore[no-untyped-def]
          index, squared):
    limit = radius * radius
    for at in numba.prange(len(order)):
        i = np.int64(at)
        slot = start[order[i]]
        index[slot] = order[i]
        squared[slot] = 0.0
        slot += 1
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cells[i] + (dx * ny + dy) * nz
                for j in range(first[row - 1], first[row + 2]):
                    d = _squared(columns, i, j)
                    if d <= limit and j != i:
                        index[slot] = order[j]
                        squared[slot] = d
                        slot += 1
