"""Point-to-plane ICP of many placements at once, on keypoints and their regional labels.

Rough, quick and alike for all: so that rivals are compared where each fits best.
"""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..common.threads import shared
from ..scan.columns import window
from ..scan.voxels import thin
from .evidence import alike
from .evidence import gap
from .evidence import ON_SURFACE
from .evidence import TANGENTIAL
from .view import View

SAMPLE = 300
"""Keypoints of the source that are fitted, where nothing else is asked for."""
FEWEST_PARTNERS = 10
"""With fewer partners a placement stays where it is."""
SOFTNESS = 0.4
"""Distances beyond this share of the reach pull less (Geman-McClure)."""


def icp(source: View, target: View, T_target_source: NDArray[np.float64], wide: int, narrow: int,
        sample: int = SAMPLE) -> NDArray[np.float64]:
    """Fit each of (H, 4, 4) placements.

    Parameters
    ----------
    wide, narrow : int
        Rounds with partners up to twice the reach of the views, and up to the reach.
    sample : int
        Keypoints of the source to fit.

    Returns
    -------
    (H, 4, 4) float64
    """
    rows = thin(len(source.points), sample)
    T = np.array(T_target_source)
    columns = target.columns
    shared(_icp, len(T), source.points[rows], source.labels[rows], T, columns.points,
           target.column_normals, target.column_labels, columns.first, columns.ny, columns.low,
           columns.edge, target.reach, wide, narrow)
    return T


def partners(source: View, target: View, T_target_source: NDArray[np.float64], sample: int
             ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows of source keypoints and of the target keypoints that they lie on, (P,) each."""
    rows = thin(len(source.points), sample)
    columns = target.columns
    found = np.empty(len(rows), np.int64)
    _partners(se3.transform(T_target_source, source.points[rows]), source.labels[rows],
              columns.points, target.column_normals, target.column_labels, columns.first,
              columns.ny, columns.low, columns.edge, target.reach,
              (ON_SURFACE * target.reach)**2, found)
    return rows[found >= 0], columns.order[found[found >= 0]]


@numba.njit(cache=True, nogil=True)
def _partners(placed, labels, others, normals, other_labels,  # type: ignore[no-untyped-def]
              columns, ny, low, edge, reach, limit, found):
    for i in range(len(placed)):
        x, y, z = placed[i]
        at, best = _nearest(x, y, z, labels[i], others, normals, other_labels, columns, ny, low,
                            edge, reach)
        found[i] = at if best <= limit else -1


@numba.njit(cache=True, nogil=True)
def _nearest(x, y, z, label, others, normals, other_labels,  # type: ignore[no-untyped-def]
             columns, ny, low, edge, reach):
    """Return the partner with the smallest gap, -1 without any, and that gap, m^2."""
    best, at = np.inf, -1
    x_first, x_last = window(x, reach, low[0], edge, (len(columns) - 1) // ny)
    y_first, y_last = window(y, reach, low[1], edge, ny)
    for column in range(x_first * ny, x_last * ny, ny):
        for k in range(columns[column + y_first], columns[column + y_last]):
            a, b, c = x - others[k, 0], y - others[k, 1], z - others[k, 2]
            squared = a * a + b * b + c * c
            if squared <= reach * reach and alike(label, other_labels[k]):
                found = gap(a, b, c, squared, normals[k])
                if found < best:
                    best, at = found, k
    return at, best


@numba.njit(cache=True, nogil=True)
def _icp(first, last, points, labels, T, others, normals, other_labels,  # type: ignore[no-untyped-def]
         columns, ny, low, edge, reach, wide, narrow):
    for h in range(first, last):
        rows = np.zeros((4, 6))    # normal, and the three axes: of translation and rotation
        errors = np.empty(4)
        H, g = np.empty((6, 6)), np.empty(6)
        for turn in range(wide + narrow):
            far = 2 * reach if turn < wide else reach
            H[:] = 0.0
            g[:] = 0.0
            partners = 0
            for i in range(len(points)):
                px, py, pz = points[i]
                lx = T[h, 0, 0] * px + T[h, 0, 1] * py + T[h, 0, 2] * pz
                ly = T[h, 1, 0] * px + T[h, 1, 1] * py + T[h, 1, 2] * pz
                lz = T[h, 2, 0] * px + T[h, 2, 1] * py + T[h, 2, 2] * pz
                x, y, z = lx + T[h, 0, 3], ly + T[h, 1, 3], lz + T[h, 2, 3]
                at, found = _nearest(x, y, z, labels[i], others, normals, other_labels, columns,
                                     ny, low, edge, far)
                if at < 0:
                    continue
                partners += 1
                ux, uy, uz = normals[at]
                ex, ey, ez = x - others[at, 0], y - others[at, 1], z - others[at, 2]
                pull = 1 / (1 + found / (SOFTNESS * far)**2)**2
                rows[0] = (ux, uy, uz, ly * uz - lz * uy, lz * ux - lx * uz, lx * uy - ly * ux)
                rows[1] = (1.0, 0.0, 0.0, 0.0, lz, -ly)
                rows[2] = (0.0, 1.0, 0.0, -lz, 0.0, lx)
                rows[3] = (0.0, 0.0, 1.0, ly, -lx, 0.0)
                errors[0], errors[1], errors[2] = ex * ux + ey * uy + ez * uz, ex, ey
                errors[3] = ez
                for r in range(4):
                    weight = pull * (1 - TANGENTIAL if r == 0 else TANGENTIAL)
                    for a in range(6):
                        g[a] += weight * rows[r, a] * errors[r]
                        for b in range(a + 1):
                            H[a, b] += weight * rows[r, a] * rows[r, b]
            if partners < FEWEST_PARTNERS:
                break
            for a in range(6):
                H[a, a] += 1e-6 * partners    # points on a line leave a turn about it free
                for b in range(a):
                    H[b, a] = H[a, b]
            _solve(H, g)
            _move(T[h], g)


@numba.njit(cache=True, nogil=True)
def _solve(H, g):  # type: ignore[no-untyped-def]
    """Replace g by the solution x of H x = g with a positive definite H, of which little stays.

    A few lines compile in a fraction of the time of numpy's own.
    """
    n = len(g)
    for a in range(n):
        for b in range(a + 1, n):
            factor = H[b, a] / H[a, a]
            g[b] -= factor * g[a]
            for c in range(a + 1, n):
                H[b, c] -= factor * H[a, c]
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            g[a] -= H[a, b] * g[b]
        g[a] /= H[a, a]


@numba.njit(cache=True, nogil=True)
def _move(T, back):  # type: ignore[no-untyped-def]
    """Move a placement back by (translation, rotation about its own origin) in its target."""
    x, y, z = -back[3], -back[4], -back[5]
    angle = math.sqrt(x * x + y * y + z * z)
    if angle > 0:
        sine, rest = math.sin(angle) / angle, (1 - math.cos(angle)) / (angle * angle)
        for c in range(3):
            # of each axis a: a + sine w x a + rest w x (w x a)
            ax, ay, az = T[0, c], T[1, c], T[2, c]
            bx, by, bz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
            T[0, c] += sine * bx + rest * (y * bz - z * by)
            T[1, c] += sine * by + rest * (z * bx - x * bz)
            T[2, c] += sine * bz + rest * (x * by - y * bx)
    for a in range(3):
        T[a, 3] -= back[a]
