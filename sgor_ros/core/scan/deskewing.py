"""Deskewing: the scan as it had been, had the sensor stood still (motion compensation)."""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..execution.threads import parallel_for
from .scan import SemanticScan

Array = NDArray[np.float64]


def deskewed(scan: SemanticScan, twist: Array) -> SemanticScan:
    """Return a scan with all points where the sensor had seen them at its stamp.

    Parameters
    ----------
    scan : SemanticScan
        With the time of each point; without, it is returned as it is.
    twist : (6,) array
        Velocity of the frame of the points in itself, m/s and rad/s, taken as constant.

    Returns
    -------
    SemanticScan
        Without times.
    """
    if scan.times is None:
        return scan
    points = np.empty_like(scan.points)
    rate = float(np.linalg.norm(twist[3:]))
    axis = twist[3:] / rate if rate else np.zeros(3)
    along = axis * (axis @ twist[:3])
    parallel_for(_move, len(points), scan.points, scan.times, axis, rate, along,
                 twist[:3] - along, np.cross(axis, twist[:3]), points)
    return scan.with_points(points)


@numba.njit(cache=True, nogil=True)
def _move(begin, end, points, times, axis, rate, along, across, sideways, moved):
    """Turn each point about the axis (Rodrigues), and add the way of the origin until then."""
    a, b, c = axis
    for i in range(begin, end):
        x, y, z = points[i]
        t = times[i]
        half = rate * t / 2
        sine, cosine = math.sin(half), math.cos(half)
        sinc = sine / half if abs(half) > 1e-9 else 1.0
        turn, bend = 2 * sine * cosine, 2 * sine * sine
        u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
        forward, beside = t * cosine * sinc, t * sine * sinc
        moved[i, 0] = (x + turn * u + bend * (b * w - c * v)
                       + t * along[0] + forward * across[0] + beside * sideways[0])
        moved[i, 1] = (y + turn * v + bend * (c * u - a * w)
                       + t * along[1] + forward * across[1] + beside * sideways[1])
        moved[i, 2] = (z + turn * w + bend * (a * v - b * u)
                       + t * along[2] + forward * across[2] + beside * sideways[2])
