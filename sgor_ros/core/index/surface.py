"""The surface of one scan for the local refinement: points in columns, each with its normal."""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..execution.threads import parallel_for
from ..features.descriptors import smallest_direction
from ..scan.scan import ORIGIN
from .columns import Columns
from .columns import in_columns
from .columns import window

NEIGHBOURS, FEWEST = 10, 5
"""Nearest points behind a normal, itself with them; with fewer than so many there is none."""
NEAR, FAR = 2, 8
"""Edges of a column in which the nearest are looked for first, and at last."""
EDGE_ON = 0.05
"""Least cosine between normal and ray. What is seen edge-on is not seen: such a normal is that of
the fan of one beam, and would hold the beams of one scan to those of another."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A thinned cloud with normals, ready for the search of nearest points.

    Attributes
    ----------
    columns : Columns
        Its points.
    normals : (V, 3) float64
        Unit normals in the order of the columns; zero where too few points are near.
    middle_range : float
        Median distance of the points from the sensor, metres.
    """

    columns: Columns
    normals: NDArray[np.float64]
    middle_range: float


def surface(points: NDArray[np.float64], edge: float,
            origin: NDArray[np.float64] = ORIGIN) -> Surface | None:
    """Sort (V, 3) thinned points into columns, and find their normals; None with too few.

    Parameters
    ----------
    points : (V, 3) float64
        Metres.
    edge : float
        Edge of the grid that thinned them, metres.
    origin : (3,) float64
        Place of the sensor, metres.
    """
    if len(points) < NEIGHBOURS:
        return None
    columns = in_columns(points, edge)
    normals = np.zeros((len(points), 3))
    parallel_for(_normals, len(points), columns.points, columns.first, columns.ny, columns.low,
                 columns.edge, origin, normals)
    rays = points - origin
    middle = float(np.median(np.sqrt(np.einsum('ij,ij->i', rays, rays))))
    return Surface(columns, normals, middle)


@numba.njit(cache=True, nogil=True)
def _normals(begin, end, points, first, ny, low, edge, origin, normals):
    nx = (len(first) - 1) // ny
    near, gaps = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS)
    for i in range(begin, end):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        reach = NEAR * edge
        found = 0
        while True:
            # the nearest ones, as far as the columns looked at hold all of them
            limit = reach * reach
            found, worst = 0, 0
            x_first, x_last = window(x, reach, low[0], edge, nx)
            y_first, y_last = window(y, reach, low[1], edge, ny)
            for column in range(x_first * ny, x_last * ny, ny):
                for j in range(first[column + y_first], first[column + y_last]):
                    a, b, c = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                    gap = a * a + b * b + c * c
                    if gap > limit:
                        continue
                    if found < NEIGHBOURS:
                        gaps[found], near[found] = gap, j
                        found += 1
                    else:
                        gaps[worst], near[worst] = gap, j
                    if found == NEIGHBOURS:
                        limit = gaps[0]
                        for k in range(1, NEIGHBOURS):
                            limit = max(limit, gaps[k])
                        for k in range(NEIGHBOURS):
                            worst = k if gaps[k] == limit else worst
            if found == NEIGHBOURS or reach >= FAR * edge:
                break
            reach *= 2.0
        if found < FEWEST:
            continue
        sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
        for k in range(found):
            j = near[k]
            a, b, c = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
            sx += a
            sy += b
            sz += c
            sxx += a * a
            sxy += a * b
            sxz += a * c
            syy += b * b
            syz += b * c
            szz += c * c
        ux, uy, uz = smallest_direction(
            sxx - sx * sx / found, sxy - sx * sy / found, sxz - sx * sz / found,
            syy - sy * sy / found, syz - sy * sz / found, szz - sz * sz / found)
        a, b, c = x - origin[0], y - origin[1], z - origin[2]
        if abs(ux * a + uy * b + uz * c) >= EDGE_ON * math.sqrt(a * a + b * b + c * c):
            normals[i] = ux, uy, uz
