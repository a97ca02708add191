"""Local refinement on the clouds by GICP, and the covariance that follows (beyond the paper)."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..config import SgorConfig
from ..execution.threads import parallel_for
from ..index.columns import window
from ..index.surface import Surface
from .covariance import between_parts
from .covariance import correlated_error
from .covariance import correlated_part
from .covariance import noise
from .normal_equations import add_pair
from .normal_equations import TERMS

FLAT = 0.999
"""How much less a point errs across its surface than along it, in variance (GICP)."""
ROUNDS = 30
STILL_M, STILL_RAD = 1e-3, np.radians(0.1)
"""Steps below which the rounds end."""
DAMPING = 1e-3
"""Added to the information: directions that no pair holds stay as they are."""
BLOCKS = 64
"""Parts of the source that are summed up one by one: so threads change nothing."""
LOWER = np.tril_indices(6)


@dataclass(frozen=True, eq=False)
class Alignment:
    """What GICP arrived at.

    Attributes
    ----------
    T_target_source : (4, 4) float64
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2; None where a
        direction is not observed at all.
    correlated_error : (6, 6) float64
        As of `Registration`.
    converged : bool
    pairs : int
        Points that found a partner.
    """

    T_target_source: NDArray[np.float64]
    covariance: NDArray[np.float64] | None
    correlated_error: NDArray[np.float64]
    converged: bool
    pairs: int


def align(source: Surface, target: Surface, T_target_source: NDArray[np.float64],
          config: SgorConfig) -> Alignment:
    """Refine a transformation by GICP, from within `gicp_max_correspondence_distance`.

    As small_gicp does it, by Gauss-Newton and with normals in place of covariances.
    """
    T = np.array(T_target_source, np.float64, order='C')
    here, there = source.columns, target.columns
    sums = np.empty((BLOCKS, TERMS + 2))    # and error and pairs
    converged = False
    for _ in range(ROUNDS):
        parallel_for(_sum_up, BLOCKS, here.points, source.normals, T, there.points,
                     target.normals, there.first, there.ny, there.low, there.edge,
                     config.gicp_max_correspondence_distance, sums)
        total = sums.sum(axis=0)
        information = np.empty((6, 6))
        information[LOWER] = information.T[LOWER] = total[:21]
        error, pairs = float(total[TERMS]), int(total[TERMS + 1])
        step = -np.linalg.solve(information + DAMPING * np.eye(6), total[21:27])
        T = se3.perturbed(T, step)
        converged = bool(np.linalg.norm(step[:3]) < STILL_M and np.linalg.norm(step[3:])
                         < STILL_RAD)
        if converged:
            break
    repeated = correlated_error(T, source.middle_range, config.voxel_size)
    random = noise(information, error, pairs)
    if random is None:
        return Alignment(T, None, repeated, converged, pairs)
    parts = between_parts(information, sums[:, 21:27])
    covariance = random + parts + repeated @ repeated.T
    return Alignment(T, covariance, correlated_part(repeated, parts), converged, pairs)


@numba.njit(cache=True, nogil=True)
def _nearest(x, y, z, points, first, ny, low, edge, reach):
    """Return the nearest point within reach, -1 without any."""
    x_first, x_last = window(x, reach, low[0], edge, (len(first) - 1) // ny)
    y_first, y_last = window(y, reach, low[1], edge, ny)
    best, at = reach * reach, -1
    for column in range(x_first * ny, x_last * ny, ny):
        for j in range(first[column + y_first], first[column + y_last]):
            a, b, c = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
            gap = a * a + b * b + c * c
            if gap <= best:
                best, at = gap, j
    return at


@numba.njit(cache=True, nogil=True)
def _sum_up(begin, end, points, normals, T, others, other_normals,
            first, ny, low, edge, reach, sums):
    """Sum up the normal equations of each block, its error and its pairs."""
    for block in range(begin, end):
        total = sums[block]
        total[:] = 0.0
        for i in range(len(points) * block // BLOCKS, len(points) * (block + 1) // BLOCKS):
            px, py, pz = points[i, 0], points[i, 1], points[i, 2]
            ax = T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz
            ay = T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz
            az = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz
            x, y, z = ax + T[0, 3], ay + T[1, 3], az + T[2, 3]
            j = _nearest(x, y, z, others, first, ny, low, edge, reach)
            if j < 0:
                continue
            px, py, pz = normals[i, 0], normals[i, 1], normals[i, 2]
            mx = T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz
            my = T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz
            mz = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz
            ux, uy, uz = other_normals[j, 0], other_normals[j, 1], other_normals[j, 2]
            # the sum of both covariances, and its inverse by cofactors
            cxx = 2.0 - FLAT * (mx * mx + ux * ux)
            cyy = 2.0 - FLAT * (my * my + uy * uy)
            czz = 2.0 - FLAT * (mz * mz + uz * uz)
            cxy = -FLAT * (mx * my + ux * uy)
            cxz = -FLAT * (mx * mz + ux * uz)
            cyz = -FLAT * (my * mz + uy * uz)
            ixx, ixy, ixz = cyy * czz - cyz * cyz, cxz * cyz - cxy * czz, cxy * cyz - cxz * cyy
            iyy, iyz, izz = cxx * czz - cxz * cxz, cxy * cxz - cxx * cyz, cxx * cyy - cxy * cxy
            scale = 1.0 / (cxx * ixx + cxy * ixy + cxz * ixz)
            ixx, ixy, ixz, iyy, iyz, izz = (ixx * scale, ixy * scale, ixz * scale, iyy * scale,
                                            iyz * scale, izz * scale)
            ex, ey, ez = x - others[j, 0], y - others[j, 1], z - others[j, 2]
            gx, gy, gz = add_pair(total, ax, ay, az, ixx, ixy, ixz, iyy, iyz, izz, ex, ey, ez)
            total[TERMS] += 0.5 * (gx * ex + gy * ey + gz * ez)
            total[TERMS + 1] += 1.0
