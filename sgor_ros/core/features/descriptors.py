"""Normals, regional labels and FPFH descriptors of the non-ground points (Sec. III-B, III-C).

The descriptor is that of Open3D's ``compute_fpfh_feature`` with a radius search, computed here
because this is where the time of a scan goes.
"""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.angles import atan2
from ..execution.threads import parallel_for
from ..scan.voxels import VoxelCloud
from ..scan.voxels import winning_labels
from .neighbours import Neighbours

BINS = 11
DESCRIPTOR_SIZE = 3 * BINS
PARTS = 4
"""Parts of the points, each with histograms of its own, for two write into those of one point."""


def regional_labels(cloud: VoxelCloud, neighbours: Neighbours, radius: float) -> NDArray[np.uint8]:
    """Vote over the raw points within `radius` metres: S(p) of Sec. III-C, (V,)."""
    votes = np.zeros_like(cloud.votes)
    if not votes.size:
        return winning_labels(votes, cloud.classes)
    parallel_for(_sum_votes, len(votes), cloud.votes, neighbours.start, neighbours.index,
                 neighbours.squared, radius * radius, votes)
    return winning_labels(votes, cloud.classes)


def normals(points: NDArray[np.float64], neighbours: Neighbours, radius: float,
            counts: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """Estimate unit normals from the neighbours within `radius` metres, towards the sensor.

    Parameters
    ----------
    points : (V, 3) float64
    neighbours : Neighbours
        Of `points`, at least as far as `radius`.
    radius : float
        Metres.
    counts : (V,) bool, optional
        Which neighbours count; default: all.

    Returns
    -------
    (V, 3) float64
        ``(0, 0, 1)`` turned to the sensor where fewer than three points lie within the radius.
    """
    found = np.empty((len(points), 3))
    counts = np.ones(len(points), np.bool_) if counts is None else counts
    parallel_for(_normals, len(points), points, neighbours.start, neighbours.index,
                 neighbours.squared, radius * radius, counts, found)
    return found


def fpfh(points: NDArray[np.float64], point_normals: NDArray[np.float64],
         neighbours: Neighbours) -> NDArray[np.float32]:
    """Fast point feature histograms over all of `neighbours`, rows L2-normalised.

    Parameters
    ----------
    points, point_normals : (V, 3) float64
    neighbours : Neighbours
        Of `points`, as far as the radius of the descriptor.

    Returns
    -------
    (V, 33) float32
        Unit rows; a row of zeros where a point has no neighbour.
    """
    counts = np.zeros((PARTS, len(points), DESCRIPTOR_SIZE), np.int32)
    parallel_for(_count_angles, PARTS, points.astype(np.float32), point_normals.astype(np.float32),
                 neighbours.start, neighbours.index, counts)
    pairs = np.maximum(np.diff(neighbours.start).astype(np.float32) - 1, 1)
    simple: NDArray[np.float32] = counts.sum(axis=0, dtype=np.float32)
    simple *= (np.float32(100.0) / pairs)[:, None]
    full = np.zeros_like(simple)
    parallel_for(_weighted_histograms, len(points), simple, neighbours.start, neighbours.index,
                 neighbours.squared, full)
    return unit_rows(full)


def unit_rows(descriptors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scale each row to length one; rows of zeros stay."""
    length = np.linalg.norm(descriptors, axis=1, keepdims=True)
    return (descriptors / np.maximum(length, 1e-12)).astype(np.float32)


@numba.njit(cache=True, nogil=True)
def _sum_votes(first, last, own, start, index, squared, limit,
               votes):
    for i in range(np.uint64(first), np.uint64(last)):
        for k in range(start[i], start[i + 1]):
            if squared[k] <= limit:
                for c in range(own.shape[1]):
                    votes[i, c] += own[index[k], c]


@numba.njit(cache=True, nogil=True)
def _normals(first, last, points, start, index, squared, limit,
             counts, found):
    for i in range(np.uint64(first), np.uint64(last)):
        n = 0
        # sums of differences to the point itself: no cancellation far from the origin
        sx = sy = sz = sxx = sxy = sxz = syy = syz = szz = 0.0
        for k in range(start[i], start[i + 1]):
            j = index[k]
            if squared[k] <= limit and counts[j]:
                x = points[j, 0] - points[i, 0]
                y = points[j, 1] - points[i, 1]
                z = points[j, 2] - points[i, 2]
                n += 1
                sx += x
                sy += y
                sz += z
                sxx += x * x
                sxy += x * y
                sxz += x * z
                syy += y * y
                syz += y * z
                szz += z * z
        x, y, z = 0.0, 0.0, 1.0
        if n >= 3:
            x, y, z = smallest_direction(
                sxx / n - sx * sx / (n * n), sxy / n - sx * sy / (n * n),
                sxz / n - sx * sz / (n * n), syy / n - sy * sy / (n * n),
                syz / n - sy * sz / (n * n), szz / n - sz * sz / (n * n))
        sign = -1.0 if x * points[i, 0] + y * points[i, 1] + z * points[i, 2] > 0 else 1.0
        found[i, 0] = sign * x
        found[i, 1] = sign * y
        found[i, 2] = sign * z


@numba.njit(cache=True, nogil=True)
def smallest_direction(xx, xy, xz, yy, yz, zz):
    """Return the unit eigenvector of the smallest eigenvalue of a symmetric 3 x 3 matrix."""
    mean = (xx + yy + zz) / 3
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = math.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if spread < 1e-12:
        return 0.0, 0.0, 1.0
    det = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz))
    half = min(max(det / (2 * spread**3), -1.0), 1.0)
    smallest = mean + 2 * spread * math.cos(math.acos(half) / 3 + 2 * math.pi / 3)
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    # rows of A - lambda I span the other two directions: the longest cross product is safest
    x1, y1, z1 = xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy
    x2, y2, z2 = xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz
    x3, y3, z3 = b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz
    l1, l2, l3 = x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2, \
        x3 * x3 + y3 * y3 + z3 * z3
    if l1 < l2:
        x1, y1, z1, l1 = x2, y2, z2, l2
    if l1 < l3:
        x1, y1, z1, l1 = x3, y3, z3, l3
    if l1 < 1e-24 * spread**4:
        # the two smaller ones are equal (points on a line): any direction across it will do
        x1, y1, z1 = _across(a, xy, xz, yy - smallest, yz, c)
        l1 = x1 * x1 + y1 * y1 + z1 * z1
    scale = 1.0 / math.sqrt(l1)
    return x1 * scale, y1 * scale, z1 * scale


@numba.njit(cache=True, nogil=True)
def _across(a, xy, xz, b, yz, c):
    """Return a direction across the longest row of a symmetric matrix of rank one."""
    if a >= b and a >= c:
        x, y, z = a, xy, xz
    elif b >= c:
        x, y, z = xy, b, yz
    else:
        x, y, z = xz, yz, c
    return (y, -x, 0.0) if abs(x) + abs(y) > abs(z) else (0.0, z, -y)


@numba.njit(cache=True, nogil=True, inline='always')
def _angle_bin(y, x):
    """Return floor(11 (atan2(y, x) + pi) / 2 pi)."""
    bin_ = np.int32((atan2(y, x) + np.float32(math.pi)) * np.float32(BINS / (2 * math.pi)))
    return min(max(bin_, 0), BINS - 1)


@numba.njit(cache=True, nogil=True, inline='always')
def _cosine_bin(cosine):
    """Return floor(11 (cosine + 1) / 2)."""
    return min(max(np.int32((cosine + 1) * np.float32(BINS / 2)), 0), BINS - 1)


@numba.njit(cache=True, nogil=True, error_model='numpy',
            fastmath={'nsz', 'arcp', 'contract', 'afn', 'reassoc'})
def _count_angles(first, last, points, normals, start, index,
                  counts):
    """SPFH of each point: angles of the Darboux frame to every neighbour, 11 bins each.

    They are the same from either end, and so are counted for both at once.
    """
    longest = np.uint64(0)
    for i in range(len(points)):
        longest = max(longest, start[i + 1] - start[i])
    later, bins = np.empty(longest, np.uint32), np.empty((3, longest), np.int32)
    # side by side, so that the compiler makes vectors of them
    copies = np.empty((6, longest), np.float32)
    cx, cy, cz, cu, cv, cw = copies[0], copies[1], copies[2], copies[3], copies[4], copies[5]
    thetas, alphas, phis = bins[0], bins[1], bins[2]
    size = np.uint64(len(points))
    parts = np.uint64(len(counts))
    for part in range(np.uint64(first), np.uint64(last)):
        own = counts[part]
        for i in range(size * part // parts, size * (part + np.uint64(1)) // parts):
            count = np.uint64(0)
            for k in range(start[i] + np.uint64(1), start[i + np.uint64(1)]):
                later[count] = index[k]
                count += np.uint64(index[k] > i)
            px, py, pz = points[i, 0], points[i, 1], points[i, 2]
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            for k in range(count):
                j = later[k]
                cx[k], cy[k], cz[k] = points[j, 0], points[j, 1], points[j, 2]
                cu[k], cv[k], cw[k] = normals[j, 0], normals[j, 1], normals[j, 2]
            for k in range(count):
                dx, dy, dz = cx[k] - px, cy[k] - py, cz[k] - pz
                mx, my, mz = cu[k], cv[k], cw[k]
                inverse = np.float32(1.0) / math.sqrt(dx * dx + dy * dy + dz * dz)
                here = (nx * dx + ny * dy + nz * dz) * inverse
                there = (mx * dx + my * dy + mz * dz) * inverse
                # the end whose normal is nearer to the line is the source of the frame
                swap = abs(here) < abs(there)
                sign = np.float32(-1.0) if swap else np.float32(1.0)
                ux = mx if swap else nx
                uy = my if swap else ny
                uz = mz if swap else nz
                tx = nx if swap else mx
                ty = ny if swap else my
                tz = nz if swap else mz
                phi = -there if swap else here
                vx = (dy * uz - dz * uy) * sign
                vy = (dz * ux - dx * uz) * sign
                vz = (dx * uy - dy * ux) * sign
                length = math.sqrt(vx * vx + vy * vy + vz * vz)
                scale = np.float32(1.0) / length if length > 0 else np.float32(0.0)
                vx *= scale
                vy *= scale
                vz *= scale
                wx = uy * vz - uz * vy
                wy = uz * vx - ux * vz
                wz = ux * vy - uy * vx
                alpha = vx * tx + vy * ty + vz * tz
                flat = length == 0
                theta_y = np.float32(0.0) if flat else wx * tx + wy * ty + wz * tz
                theta_x = np.float32(1.0) if flat else ux * tx + uy * ty + uz * tz
                phi = np.float32(0.0) if flat else phi
                thetas[k] = _angle_bin(theta_y, theta_x)
                alphas[k] = BINS + _cosine_bin(alpha)
                phis[k] = 2 * BINS + _cosine_bin(phi)
            here_counts = own[i]
            for k in range(count):
                there_counts = own[later[k]]
                for angle in range(3):
                    here_counts[bins[angle, k]] += 1
                    there_counts[bins[angle, k]] += 1


@numba.njit(cache=True, nogil=True, error_model='numpy', fastmath=True)
def _weighted_histograms(first, last, simple, start, index, squared,
                         full):
    """FPFH: own SPFH plus those of the neighbours by inverse squared distance."""
    for i in range(np.uint64(first), np.uint64(last)):
        total = np.zeros(simple.shape[1], np.float32)
        for k in range(start[i] + 1, start[i + 1]):
            if squared[k] > 0:
                weight = np.float32(1.0) / squared[k]
                j = index[k]
                for b in range(total.size):
                    total[b] += weight * simple[j, b]
        for part in range(3):
            mass = np.float32(0.0)
            for b in range(part * BINS, (part + 1) * BINS):
                mass += total[b]
            scale = np.float32(100.0) / mass if mass > 0 else np.float32(0.0)
            for b in range(part * BINS, (part + 1) * BINS):
                full[i, b] = simple[i, b] + scale * total[b]
