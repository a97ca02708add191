"""The range image of one scan: how far it has seen in each direction."""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.products import times_transposed
from ..scan.directions import AZIMUTHS
from ..scan.directions import cells_and_ranges
from ..scan.directions import ELEVATIONS
from ..scan.directions import Rays

BLOCK = 15
"""Cells along the edge of the blocks by which views are compared, wider than beams lie apart."""


def range_image(rays: Rays, kept: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the shortest range measured in each direction or next to it, metres.

    Of the returns of a scan that are kept, (N,) bool: it has looked through all before them.
    """
    return _shortest_around(_nearest(rays.first, rays.ranges, rays.order, kept).reshape(
        AZIMUTHS, ELEVATIONS))


def view_overlap(ranges: NDArray[np.float32], R_other_sensor: NDArray[np.float64]) -> float:
    """Return the share of what a sensor sees that it would see too if it were turned, 0 to 1.

    All of it for one that spins, whatever its yaw; less the farther one of narrow view is turned.

    Parameters
    ----------
    ranges : (360, 180) float32
        Its `range_image`.
    R_other_sensor : (3, 3) float64
        From the one orientation to the other.
    """
    seen = np.isfinite(ranges).reshape(AZIMUTHS // BLOCK, BLOCK, ELEVATIONS // BLOCK, BLOCK).any(
        axis=(1, 3))
    rows, columns = np.nonzero(seen)
    azimuth = ((rows + 0.5) * BLOCK / AZIMUTHS - 0.5) * 2 * math.pi
    elevation = ((columns + 0.5) * BLOCK / ELEVATIONS - 0.5) * math.pi
    ways = np.column_stack((np.cos(elevation) * np.cos(azimuth),
                            np.cos(elevation) * np.sin(azimuth), np.sin(elevation)))
    cells, _ = cells_and_ranges(times_transposed(ways, R_other_sensor).astype(np.float32))
    turned, tilted = np.divmod(cells, ELEVATIONS)
    return float(seen[turned // BLOCK, tilted // BLOCK].mean())


@numba.njit(cache=True, nogil=True)
def _nearest(first, ranges, order, kept):
    nearest = np.full(len(first) - 1, np.inf, np.float32)
    for cell in range(len(nearest)):
        for i in range(first[cell], first[cell + 1]):
            if kept[order[i]] and 0 < ranges[i] < nearest[cell]:
                nearest[cell] = ranges[i]
    return nearest


def _shortest_around(nearest: NDArray[np.float32]) -> NDArray[np.float32]:
    """Take the shortest of the cell and its 8 neighbours where something was measured.

    At the edge of a thing the sensor has looked past it, not through it.
    """
    around = np.minimum(nearest, np.minimum(np.roll(nearest, 1, axis=0),
                                            np.roll(nearest, -1, axis=0)))
    shortest = around.copy()
    np.minimum(shortest[:, 1:], around[:, :-1], out=shortest[:, 1:])
    np.minimum(shortest[:, :-1], around[:, 1:], out=shortest[:, :-1])
    shortest[nearest == np.inf] = np.inf
    return shortest
