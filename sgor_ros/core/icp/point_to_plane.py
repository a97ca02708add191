"""Point-to-plane ICP of many poses at once, on keypoints and their regional labels.

Rough, quick and alike for all: so that competing poses are compared where each fits best.
"""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..execution.threads import parallel_for
from ..index.columns import window
from ..index.scan_index import ScanIndex
from ..scan.voxels import thin
from ..scoring.pose_scoring import alike
from ..scoring.pose_scoring import gap
from ..scoring.pose_scoring import ON_SURFACE
from ..scoring.pose_scoring import TANGENTIAL
from .normal_equations import add_pair
from .normal_equations import TERMS

KEYPOINTS = 300
"""Keypoints of the source that are fitted, where nothing else is asked for."""
FEWEST_PARTNERS = 10
"""With fewer partners a pose stays where it is."""
SOFTNESS = 0.4
"""Distances beyond this share of the maximum distance pull less (Geman-McClure)."""


def icp(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64], wide: int,
        narrow: int, keypoints: int = KEYPOINTS) -> NDArray[np.float64]:
    """Fit each of (H, 4, 4) poses.

    Parameters
    ----------
    wide, narrow : int
        Rounds with partners up to twice the maximum correspondence distance, and up to it.
    keypoints : int
        Keypoints of the source to fit.

    Returns
    -------
    (H, 4, 4) float64
    """
    rows = thin(len(source.points), keypoints)
    T = np.array(T_target_source, order='C')
    columns = target.columns
    parallel_for(_icp, len(T), source.points[rows], source.labels[rows], T, columns.points,
                 target.column_normals, target.column_labels, columns.first, columns.ny,
                 columns.low, columns.edge, target.max_distance, wide, narrow)
    return T


def partners(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64],
             keypoints: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows of source keypoints and of the target keypoints that they lie on, (P,) each."""
    rows = thin(len(source.points), keypoints)
    columns = target.columns
    found = np.empty(len(rows), np.int64)
    _partners(se3.transform(T_target_source, source.points[rows]), source.labels[rows],
              columns.points, target.column_normals, target.column_labels, columns.first,
              columns.ny, columns.low, columns.edge, target.max_distance,
              (ON_SURFACE * target.max_distance)**2, found)
    return rows[found >= 0], columns.order[found[found >= 0]]


@numba.njit(cache=True, nogil=True)
def _partners(placed, labels, others, normals, other_labels, columns, width, low, edge, reach,
              limit, found):
    for i in range(len(placed)):
        at, best = _nearest(placed[i, 0], placed[i, 1], placed[i, 2], labels[i], others,
                            normals, other_labels, columns, width, low, edge, reach)
        found[i] = at if best <= limit else -1


@numba.njit(cache=True, nogil=True)
def _nearest(x, y, z, label, others, normals, other_labels, columns, width, low, edge, reach):
    """Return the partner with the smallest gap, -1 without any, and that gap, m^2."""
    best, at = np.inf, -1
    x_first, x_last = window(x, reach, low[0], edge, (len(columns) - 1) // width)
    y_first, y_last = window(y, reach, low[1], edge, width)
    for column in range(x_first * width, x_last * width, width):
        for k in range(columns[column + y_first], columns[column + y_last]):
            a, b, c = x - others[k, 0], y - others[k, 1], z - others[k, 2]
            squared = a * a + b * b + c * c
            if squared <= reach * reach and alike(label, other_labels[k]):
                found = gap(a, b, c, squared, normals[k])
                if found < best:
                    best, at = found, k
    return at, best


@numba.njit(cache=True, nogil=True, error_model='numpy')
def _icp(first, last, points, labels, T, others, normals, other_labels,
         columns, width, low, edge, reach, wide, narrow):
    total, H, g = np.empty(TERMS), np.empty((6, 6)), np.empty(6)
    for h in range(first, last):
        for turn in range(wide + narrow):
            far = 2 * reach if turn < wide else reach
            total[:] = 0.0
            partners = 0
            for i in range(len(points)):
                px, py, pz = points[i, 0], points[i, 1], points[i, 2]
                lx = T[h, 0, 0] * px + T[h, 0, 1] * py + T[h, 0, 2] * pz
                ly = T[h, 1, 0] * px + T[h, 1, 1] * py + T[h, 1, 2] * pz
                lz = T[h, 2, 0] * px + T[h, 2, 1] * py + T[h, 2, 2] * pz
                x, y, z = lx + T[h, 0, 3], ly + T[h, 1, 3], lz + T[h, 2, 3]
                at, found = _nearest(x, y, z, labels[i], others, normals, other_labels, columns,
                                     width, low, edge, far)
                if at < 0:
                    continue
                partners += 1
                nx, ny, nz = normals[at, 0], normals[at, 1], normals[at, 2]
                pull = 1 / (1 + found / (SOFTNESS * far)**2)**2
                # in full across the surface, a share of it along
                across, along = pull * (1 - TANGENTIAL), pull * TANGENTIAL
                add_pair(total, lx, ly, lz,
                         across * nx * nx + along, across * nx * ny, across * nx * nz,
                         across * ny * ny + along, across * ny * nz, across * nz * nz + along,
                         x - others[at, 0], y - others[at, 1], z - others[at, 2])
            if partners < FEWEST_PARTNERS:
                break
            k = 0
            for a in range(6):
                for b in range(a + 1):
                    H[a, b] = total[k]
                    k += 1
                H[a, a] += 1e-6 * partners    # points on a line leave a turn about it free
                g[a] = total[21 + a]
            _solve(H, g)
            _turn(T[h], g)


@numba.njit(cache=True, nogil=True, error_model='numpy')
def _solve(H, g):
    """Replace g by the solution of H x = g, H positive definite and given below its diagonal.

    By hand, like `_turn`: numpy's functions take numba seconds to compile.
    """
    for k in range(len(g)):
        for a in range(k + 1, len(g)):
            share = H[a, k] / H[k, k]
            g[a] -= share * g[k]
            for b in range(k + 1, a + 1):
                H[a, b] -= share * H[b, k]
    for k in range(len(g) - 1, -1, -1):
        for a in range(k + 1, len(g)):
            g[k] -= H[a, k] * g[a]
        g[k] /= H[k, k]


@numba.njit(cache=True, nogil=True, error_model='numpy')
def _turn(T, back):
    """Move a placement back by (translation, rotation about its own origin), target frame."""
    angle = math.sqrt(back[3] * back[3] + back[4] * back[4] + back[5] * back[5])
    if angle > 0:
        kx, ky, kz = -back[3] / angle, -back[4] / angle, -back[5] / angle
        sine, rest = math.sin(angle), 1 - math.cos(angle)
        for c in range(3):    # Rodrigues
            x, y, z = T[0, c], T[1, c], T[2, c]
            ux, uy, uz = ky * z - kz * y, kz * x - kx * z, kx * y - ky * x
            T[0, c] += sine * ux + rest * (ky * uz - kz * uy)
            T[1, c] += sine * uy + rest * (kz * ux - kx * uz)
            T[2, c] += sine * uz + rest * (kx * uy - ky * ux)
    T[0, 3] -= back[0]
    T[1, 3] -= back[1]
    T[2, 3] -= back[2]
