"""Radius neighbours of all points of one cloud: one search for votes, normals and features."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

MAX_CELLS = 4_000_000
"""Bound on the memory of the search grid; beyond it cells grow, which only costs time."""


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
    shape = np.floor(extent / cell).astype(np.int64) + 3
    # a border of empty cells on each side spares the bounds checks
    coordinates = np.floor((points - low) / cell).astype(np.int64) + 1
    cells = (coordinates[:, 0] * shape[1] + coordinates[:, 1]) * shape[2] + coordinates[:, 2]
    order = np.argsort(cells, kind='stable').astype(np.int32)
    first = np.searchsorted(cells[order], np.arange(np.prod(shape) + 1)).astype(np.int32)
    start = np.zeros(len(points) + 1, np.int64)
    _count(points, cells, order, first, shape[1], shape[2], radius, start)
    np.cumsum(start, out=start)
    index = np.empty(start[-1], np.int32)
    squared = np.empty(start[-1], np.float32)
    _fill(points, cells, order, first, shape[1], shape[2], radius, start, index, squared)
    return Neighbours(start, index, squared)


@numba.njit(cache=True, nogil=True, parallel=True)
def _count(points, cells, order, first, ny, nz, radius, start):  # type: ignore[no-untyped-def]
    limit = radius * radius
    for i in numba.prange(len(points)):
        found = 0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cells[i] + (dx * ny + dy) * nz
                for k in range(first[row - 1], first[row + 2]):
                    j = order[k]
                    a = points[j, 0] - points[i, 0]
                    b = points[j, 1] - points[i, 1]
                    c = points[j, 2] - points[i, 2]
                    if a * a + b * b + c * c <= limit:
                        found += 1
        start[i + 1] = found


@numba.njit(cache=True, nogil=True, parallel=True)
def _fill(points, cells, order, first, ny, nz, radius, start,
          index, squared):  # type: ignore[no-untyped-def]
    limit = radius * radius
    for i in numba.prange(len(points)):
        at = start[i]
        index[at] = i
        squared[at] = 0.0
        at += 1
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cells[i] + (dx * ny + dy) * nz
                for k in range(first[row - 1], first[row + 2]):
                    j = order[k]
                    a = points[j, 0] - points[i, 0]
                    b = points[j, 1] - points[i, 1]
                    c = points[j, 2] - points[i, 2]
                    d = a * a + b * b + c * c
                    if d <= limit and j != i:
                        index[at] = j
                        squared[at] = d
                        at += 1
