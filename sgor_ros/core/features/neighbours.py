"""Radius neighbours of all points of one cloud: one search for votes, normals and features."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..execution.threads import parallel_for

MAX_CELLS = 250_000
"""Bound on the search grid: beyond it empty cells would cost more than longer candidate lists."""
MOST_CANDIDATES = 20_000_000
"""Pairs of points to look at, some tenths of a second. Beyond it, as no surface of a scan is, of a
point's candidates every second, third or so is looked at."""


@dataclass(frozen=True)
class Neighbours:
    """Pairs of points nearer than a radius, in compressed rows.

    Attributes
    ----------
    start : (V + 1,) uint64
        Row i holds the neighbours ``index[start[i]:start[i + 1]]``, the point itself first.
    index : (M,) uint32
        Unsigned, see `graph`.
    squared : (M,) float32
        Squared distances, m^2.
    """

    start: NDArray[np.uint64]
    index: NDArray[np.uint32]
    squared: NDArray[np.float32]


def radius_neighbours(points: NDArray[np.float64], radius: float) -> Neighbours:
    """Find for every point all points of the same cloud within `radius` metres.

    In a cloud denser than any scan, see `MOST_CANDIDATES`, an even share of them.

    Parameters
    ----------
    points : (V, 3) float64
    radius : float
        Metres.
    """
    if len(points) == 0:
        return Neighbours(np.zeros(1, np.uint64), np.empty(0, np.uint32), np.empty(0, np.float32))
    low = points.min(axis=0)
    extent = points.max(axis=0) - low
    cell = radius
    while np.prod(np.floor(extent / cell) + 3.0) > MAX_CELLS:
        cell *= 1.5
    # a border of empty cells on each side spares the bounds checks
    shape = np.floor(extent / cell).astype(np.int64) + 3
    x, y, z = np.floor((points - low) / cell).astype(np.int64).T + 1
    cells = (x * shape[1] + y) * shape[2] + z
    order = np.argsort(cells, kind='stable').astype(np.uint32)
    first = np.zeros(np.prod(shape) + 1, np.uint32)
    np.cumsum(np.bincount(cells, minlength=np.prod(shape)), out=first[1:])
    columns = np.ascontiguousarray(points[order].T)
    cells = cells[order]
    step = -(-_candidates(cells, first, shape[1], shape[2]) // MOST_CANDIDATES)
    grid = columns, cells, order, first, shape[1], shape[2], radius * radius, step
    start = np.zeros(len(points) + 1, np.uint64)
    parallel_for(_count, len(points), *grid, start)
    np.cumsum(start, out=start)
    index = np.empty(start[-1], np.uint32)
    squared = np.empty(start[-1], np.float32)
    longest = int(np.diff(start).max())
    parallel_for(_fill, len(points), *grid, start, longest, index, squared)
    return Neighbours(start, index, squared)


@numba.njit(cache=True, nogil=True)
def _candidates(cells, first, ny, nz):
    """Return the pairs of points in cells that touch each other."""
    total = np.int64(0)
    for cell in cells:
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cell + (dx * ny + dy) * nz
                total = total + np.int64(first[row + 2]) - np.int64(first[row - 1])
    return total


@numba.njit(cache=True, nogil=True)
def _count(begin, end, columns, cells, order, first, ny, nz, limit,
           step, start):
    for at in range(np.uint64(begin), np.uint64(end)):
        x, y, z = columns[:, at]
        found = 0
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cells[at] + (dx * ny + dy) * nz
                if step == 1:
                    # slices let the compiler use vectors
                    run = columns[:, first[row - 1]:first[row + 2]]
                    for j in range(run.shape[1]):
                        a, b, c = run[0, j] - x, run[1, j] - y, run[2, j] - z
                        found += a * a + b * b + c * c <= limit
                else:
                    for j in range(first[row - 1], first[row + 2], step):
                        a, b, c = columns[0, j] - x, columns[1, j] - y, columns[2, j] - z
                        found += (a * a + b * b + c * c <= limit) & (j != at)
        start[order[at] + 1] = found + (step > 1)    # and itself


@numba.njit(cache=True, nogil=True)
def _fill(begin, end, columns, cells, order, first, ny, nz, limit,
          step, start, longest, index, squared):
    # room for one candidate more than stay: every candidate is written, without a branch
    near, gap = np.empty(longest + 1, np.uint32), np.empty(longest + 1, np.float32)
    for at in range(np.uint64(begin), np.uint64(end)):
        x, y, z = columns[:, at]
        near[0], gap[0] = order[at], 0.0
        found = np.uint64(1)
        for dx in range(-1, 2):
            for dy in range(-1, 2):
                row = cells[at] + (dx * ny + dy) * nz
                for j in range(np.uint64(first[row - 1]), np.uint64(first[row + 2]),
                               np.uint64(step)):
                    a, b, c = columns[0, j] - x, columns[1, j] - y, columns[2, j] - z
                    d = a * a + b * b + c * c
                    near[found], gap[found] = order[j], d
                    found += np.uint64((d <= limit) & (j != at))
        first_of = start[order[at]]
        for k in range(found):
            index[first_of + k] = near[k]
            squared[first_of + k] = gap[k]
