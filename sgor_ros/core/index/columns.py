"""Points sorted into upright columns, to find those near a place."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

MOST_COLUMNS = 250_000
"""Bound on the columns: beyond it empty ones would cost more than full ones."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Points in columns along z.

    Attributes
    ----------
    order : (V,) int
        Which point comes where.
    points : (V, 3) float64
        Metres, in that order.
    first : (nx * ny + 1,) int64
        Column c holds the points ``first[c]`` to ``first[c + 1] - 1``.
    ny : int
        Columns along y.
    low : (2,) float64
        Where the columns begin, metres.
    edge : float
        Of a column along x and y, metres.
    """

    order: NDArray[np.intp]
    points: NDArray[np.float64]
    first: NDArray[np.int64]
    ny: int
    low: NDArray[np.float64]
    edge: float


def in_columns(points: NDArray[np.float64], edge: float) -> Columns:
    """Sort (V, 3) points into columns of an edge, metres, or a wider one where they reach far."""
    if not len(points):
        return Columns(np.empty(0, np.intp), points, np.zeros(2, np.int64), 1, np.zeros(2), edge)
    low = points[:, :2].min(axis=0)
    extent = points[:, :2].max(axis=0) - low
    while np.prod(np.floor(extent / edge) + 1.0) > MOST_COLUMNS:
        edge *= 1.5
    nx, ny = np.floor(extent / edge).astype(np.int64) + 1
    x, y = np.floor((points[:, :2] - low) / edge).astype(np.int64).T
    columns = x * ny + y
    order = np.argsort(columns, kind='stable')
    first = np.zeros(nx * ny + 1, np.int64)
    np.cumsum(np.bincount(columns, minlength=nx * ny), out=first[1:])
    return Columns(order, points[order], first, int(ny), low, edge)


@numba.njit(cache=True, nogil=True, inline='always')
def window(value, reach, low, edge, count):
    """Return the first column within reach of a value, and the one after the last."""
    # bounded before they are whole numbers: what is far away may be farther than those go
    return (np.int64(min(max(np.floor((value - reach - low) / edge), 0.0), count)),
            np.int64(min(max(np.floor((value + reach - low) / edge) + 1.0, 0.0), count)))
