"""The range image of one scan: how far it has seen in each direction."""
import numba
import numpy as np
from numpy.typing import NDArray

from ..scan.directions import AZIMUTHS
from ..scan.directions import ELEVATIONS
from ..scan.directions import Rays


def range_image(rays: Rays, kept: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the shortest range measured in each direction or next to it, metres.

    Of the returns of a scan that are kept, (N,) bool: it has looked through all before them.
    """
    return _shortest_around(_nearest(rays.first, rays.ranges, rays.order, kept).reshape(
        AZIMUTHS, ELEVATIONS))


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
