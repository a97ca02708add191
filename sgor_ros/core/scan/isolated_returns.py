"""Isolated returns: rain, dust, snow and ghosts, which are no surface (beyond the paper).

A surface returns many of the rays around a direction from nearly the same range; a drop or a
flake returns one. How many are asked for follows from how many rays a surface of the size of a
voxel would have caught there, so sparse and dense sensors are judged alike.
"""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..execution.threads import parallel_for
from .directions import AZIMUTHS
from .directions import ELEVATIONS
from .directions import Rays

WINDOW = math.radians(3.0)
"""Width of what is around a direction: its cell and the 8 next to it."""
FEW = 3
"""Where a surface of one voxel would have caught fewer rays, one return may be all of it."""
SHARE = 0.05
"""A surface of one voxel returns this share of the rays that pass through its place, or more."""
MOST = 6
"""So many others at the same range are a surface in any case."""
ALONE = 4
"""More returns in a cell, within one voxel of each other and nothing else, are a surface too."""
DEPTH_VOXELS, DEPTH_SHARE = 0.5, 0.01
"""How much the ranges of one surface differ: in voxels, and as a share of the range."""


def not_isolated(rays: Rays, voxel_size: float) -> NDArray[np.bool_]:
    """Return which of the N returns have others around them at the same range, (N,) bool.

    In the order that the scan has, not that of the rays.

    Parameters
    ----------
    rays : Rays
    voxel_size : float
        Edge of the voxels that they will be thinned by, metres.
    """
    kept = np.empty(len(rays.order), np.bool_)
    parallel_for(_judge, AZIMUTHS, rays.first, rays.ranges, np.float32(voxel_size), rays.order,
                 kept)
    return kept


@numba.njit(cache=True, nogil=True)
def _judge(begin, end, first, ranges, voxel, order, kept):
    for azimuth in range(begin, end):
        for elevation in range(ELEVATIONS):
            cell = azimuth * ELEVATIONS + elevation
            if first[cell] == first[cell + 1]:
                continue
            nearest = farthest = ranges[first[cell]]
            for i in range(first[cell], first[cell + 1]):
                nearest, farthest = min(nearest, ranges[i]), max(farthest, ranges[i])
            # most cells show one surface
            if farthest - nearest <= voxel and first[cell + 1] - first[cell] > ALONE:
                for i in range(first[cell], first[cell + 1]):
                    kept[order[i]] = True
                continue
            low, high = max(elevation - 1, 0), min(elevation + 1, ELEVATIONS - 1)
            around = 0
            for step in range(-1, 2):
                row = (azimuth + step) % AZIMUTHS * ELEVATIONS
                around += first[row + high + 1] - first[row + low]
            for i in range(first[cell], first[cell + 1]):
                expected = around * min(1.0, (voxel / (ranges[i] * WINDOW + 1e-9))**2)
                if expected < FEW:
                    kept[order[i]] = True
                    continue
                needed = min(max(round(SHARE * expected), 1), MOST)
                depth = np.float32(DEPTH_VOXELS * voxel + DEPTH_SHARE * ranges[i])
                kept[order[i]] = _has_neighbours(
                    ranges[i], depth, azimuth, cell, low, high, needed, first, ranges)


@numba.njit(cache=True, nogil=True)
def _has_neighbours(r, depth, azimuth, cell, low, high, needed, first, ranges):
    """Return whether as many others as needed lie within a depth, asking the cell first."""
    near, far = r - depth, r + depth
    own = _count(ranges[first[cell]:first[cell + 1]], near, far)
    found = own - 1    # without the return itself
    if found >= needed:
        return True
    for step in range(-1, 2):
        row = (azimuth + step) % AZIMUTHS * ELEVATIONS
        found += _count(ranges[first[row + low]:first[row + high + 1]], near, far)
        if step == 0:
            found -= own
        if found >= needed:
            return True
    return False


@numba.njit(cache=True, nogil=True, inline='always')
def _count(ranges, near, far):
    """Return how many lie from near to far; without a branch, for vector instructions."""
    count = np.int32(0)
    for k in range(len(ranges)):
        count += np.int32((ranges[k] >= near) & (ranges[k] <= far))
    return count
