"""The range image of one scan: how far it has seen in each direction."""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.angles import atan2

AZIMUTHS, ELEVATIONS = 360, 180
"""Cells of the range image: 1 degree, wider than the gaps between beams."""


@numba.njit(cache=True, nogil=True, inline='always')
def direction(x, y, z):
    """Return the cell of the range image that a point is seen in."""
    azimuth = int((atan2(y, x) / (2 * math.pi) + 0.5) * AZIMUTHS)
    elevation = int((atan2(z, math.sqrt(x * x + y * y)) / math.pi + 0.5) * ELEVATIONS)
    return min(max(azimuth, 0), AZIMUTHS - 1), min(max(elevation, 0), ELEVATIONS - 1)


def range_image(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the shortest range measured in each direction or next to it, metres.

    Of all (N, 3) points of a scan, in the sensor frame: it has looked through all before them.
    """
    return _shortest_around(_range_image(points))


@numba.njit(cache=True, nogil=True)
def _range_image(points):
    nearest = np.full((AZIMUTHS, ELEVATIONS), np.inf, np.float32)
    for i in range(len(points)):
        x, y, z = points[i]
        r = math.sqrt(x * x + y * y + z * z)
        if r > 0:
            a, e = direction(x, y, z)
            nearest[a, e] = min(nearest[a, e], r)
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
