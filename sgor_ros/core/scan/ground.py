"""Secondary ground segmentation (Sec. III-B, Eq. 2 and 3; normal by Eq. 16)."""
from dataclasses import dataclass
from dataclasses import replace
from typing import Literal

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.products import scatter
from ..common.products import times_vector
from ..config import SgorConfig
from .scan import ORIGIN
from .voxels import VoxelCloud

TRIALS, SAMPLE, SEED = 200, 1000, 0
"""Planes tried by RANSAC, and points asked about each."""

ALONG, LEAST_GROUND = np.cos(np.radians(30.0)), 0.05
"""A plane across the axis that is held to be vertical, by this cosine, is the ground before any
other, if it holds this share of the points near the sensor."""
CLEARLY = 2.0
"""So many times the score of any plane of another direction makes a ground across the sensor's
axis certain."""


@dataclass(frozen=True)
class Ground:
    """The ground plane of one scan: points x on it have ``normal @ x + offset = 0``.

    Attributes
    ----------
    normal : (3,) float64
        Unit normal n, up: towards what stands on the plane.
    offset : float
        Height of the origin over the plane, metres.
    mask : (V,) bool
        Which voxels are ground.
    source : {'labels', 'geometry'}
        Where the first guess of the ground came from.
    certain : bool
        Whether labels, the mount or the planes themselves leave no doubt that it is no wall and
        no ceiling.
    """

    normal: NDArray[np.float64]
    offset: float
    mask: NDArray[np.bool_]
    source: Literal['labels', 'geometry']
    certain: bool = True

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distance of each point over the plane, (N,) metres."""
        return times_vector(points, self.normal) + self.offset


@dataclass(frozen=True)
class Up:
    """What is known of the direction up before the scan is looked at.

    Attributes
    ----------
    direction : (3,) float64
        Unit vector.
    told : bool
        Whether the mount says so. Else it was that of the scan before, and holds as long as a
        plane agrees.
    """

    direction: NDArray[np.float64]
    told: bool


def segment_ground(cloud: VoxelCloud, ground_classes: frozenset[int], config: SgorConfig,
                   up: Up | None = None, origin: NDArray[np.float64] = ORIGIN) -> Ground | None:
    """Find the ground by labels, plane by consensus, distance to it, and plane again.

    Parameters
    ----------
    cloud : VoxelCloud
    ground_classes : frozenset of int
    config : SgorConfig
    up : Up, optional
    origin : (3,) float64
        Place of the sensor, metres.

    Returns
    -------
    Ground or None
        None where neither labels nor geometry show a ground plane.
    """
    by_label = np.isin(cloud.labels, list(ground_classes))
    if by_label.sum() >= config.min_ground_points:
        return _by_labels(cloud.points, by_label, up, origin, config)
    return _by_geometry(cloud.points, up, origin, config)


def printed_ground(cloud: VoxelCloud, points: NDArray[np.float32], labels: NDArray[np.uint8],
                   ground_classes: frozenset[int], config: SgorConfig) -> Ground | None:
    """Find the ground as printed: SVD of all (N, 3) points of the ground, distance, SVD again.

    Returns
    -------
    Ground or None
        None where the labels show no ground.
    """
    by_label = np.isin(labels, list(ground_classes))
    mask: NDArray[np.bool_] = np.isin(cloud.labels, list(ground_classes))
    if mask.sum() < config.min_ground_points:
        return None
    exact = points.astype(np.float64)
    normal, offset = fit_plane(exact[by_label])
    if not config.secondary_ground:
        return Ground(normal, offset, mask, 'labels')
    near, near_voxels = (np.abs(times_vector(each, normal) + offset) < config.sigma_g
                         for each in (exact, cloud.points))
    if config.labelled_ground:
        near, near_voxels = near & by_label, near_voxels & mask
    if near_voxels.sum() < config.min_ground_points:
        return None
    normal, offset = fit_plane(exact[near])
    return Ground(normal, offset, near_voxels, 'labels')


def fit_plane(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Fit a plane by SVD of the scatter (Eq. 16); normal towards the origin.

    Returns
    -------
    normal : (3,) float64
    offset : float
        Distance of the origin from the plane, metres, not negative.
    """
    mean = points.mean(axis=0)
    centred = points - mean
    normal = np.linalg.svd(scatter(centred))[2][-1]
    offset = -float(normal @ mean)
    return (normal, offset) if offset >= 0 else (-normal, -offset)


def _near(points: NDArray[np.float64], origin: NDArray[np.float64], config: SgorConfig
          ) -> NDArray[np.bool_]:
    """Return which points are near the sensor, (V,)."""
    near: NDArray[np.bool_] = np.linalg.norm(points - origin, axis=1) < config.ground_radius
    return near


def _by_labels(points: NDArray[np.float64], by_label: NDArray[np.bool_], up: Up | None,
               origin: NDArray[np.float64], config: SgorConfig) -> Ground | None:
    if not config.secondary_ground:
        return Ground(*fit_plane(points[by_label]), by_label, 'labels')
    # wrong labels and far slopes would tilt the first plane
    near = _near(points, origin, config)
    seed = by_label & near if (by_label & near).sum() >= config.min_ground_points else by_label
    ground = _by_consensus(points, points[seed], points[near], 'labels', up, config)
    if ground is not None and config.labelled_ground:
        ground = replace(ground, mask=ground.mask & by_label)
    return ground


def _by_geometry(points: NDArray[np.float64], up: Up | None, origin: NDArray[np.float64],
                 config: SgorConfig) -> Ground | None:
    near = points[_near(points, origin, config)]
    if len(near) < config.min_ground_points:
        return None
    return _by_consensus(points, near, near, 'geometry', up, config)


def _by_consensus(points: NDArray[np.float64], candidates: NDArray[np.float64],
                  near: NDArray[np.float64], source: Literal['labels', 'geometry'], up: Up | None,
                  config: SgorConfig) -> Ground | None:
    """Find the plane through most candidates that has next to nothing below it (RANSAC).

    Above is where most of the points near the sensor are: they stand on the ground.
    """
    rng = np.random.default_rng(SEED)
    corners = candidates[rng.integers(len(candidates), size=(TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    offsets = -np.einsum('ij,ij->i', normals, corners[:, 0])
    told = up.direction if up is not None and up.told else None
    sample = _thinned(candidates)
    on_plane, above, below = _sides(sample, normals, offsets, config.sigma_g)
    if told is None:
        _, over, under = (on_plane, above, below) if near is candidates else _sides(
            _thinned(near), normals, offsets, config.sigma_g)
        flip = under > over
    else:
        flip = normals @ told < 0
    normals[flip], offsets[flip] = -normals[flip], -offsets[flip]
    # what lies below a wall or a table plane tells it from the ground
    score = on_plane - 3 * np.where(flip, above, below)
    score[length[:, 0] == 0] = 0
    if source == 'labels':
        best, certain = int(np.argmax(score)), True
    else:
        if told is not None:
            score[normals @ told < ALONG] = 0
        best, certain = _most_likely(normals, score, len(sample), up)
    normal, offset = normals[best], float(offsets[best])
    on = np.abs(times_vector(candidates, normal) + offset) < config.sigma_g
    if score[best] <= 0 or on.sum() < config.min_ground_points:
        return None
    for _ in range(2):
        fitted, offset = fit_plane(candidates[on])
        if fitted @ normal < 0:
            fitted, offset = -fitted, -offset
        normal = fitted
        on = np.abs(times_vector(candidates, normal) + offset) < config.sigma_g
        if on.sum() < config.min_ground_points:
            return None
    return Ground(normal, offset, np.abs(times_vector(points, normal) + offset) < config.sigma_g,
                  source, certain)


def _thinned(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points[::max(len(points) // SAMPLE, 1)]


def _sides(points: NDArray[np.float64], normals: NDArray[np.float64],
           offsets: NDArray[np.float64], thickness: float) -> NDArray[np.int64]:
    """Return how many points are on each of K planes, clearly above and clearly below: (3, K)."""
    counts = np.empty((3, len(normals)), np.int64)
    _count_sides(np.ascontiguousarray(points.T), normals, offsets, thickness, counts)
    return counts


@numba.njit(cache=True, nogil=True, fastmath={'contract', 'nsz', 'reassoc'})
def _count_sides(xyz, normals, offsets, thickness, counts):
    for k in range(len(normals)):
        on = above = below = 0
        for i in range(xyz.shape[1]):
            height = (normals[k, 0] * xyz[0, i] + normals[k, 1] * xyz[1, i]
                      + normals[k, 2] * xyz[2, i] + offsets[k])
            on += abs(height) < thickness
            above += height > 2 * thickness
            below += height < -2 * thickness
        counts[0, k], counts[1, k], counts[2, k] = on, above, below


def _most_likely(normals: NDArray[np.float64], score: NDArray[np.intp], asked: int,
                 up: Up | None) -> tuple[int, bool]:
    """Return which plane is the ground, and whether that is certain.

    One across the direction up where that is told, or was that of the scan before; else one
    across the sensor's z axis, whichever end is up; else the best.
    """
    best = int(np.argmax(score))
    along = np.abs(normals[:, 2]) if up is None else normals @ up.direction
    if up is not None and not up.told and score[along > ALONG].max(initial=0) < (
            asked * LEAST_GROUND):
        along = np.abs(normals[:, 2])    # what was up is no more
    if score[along > ALONG].max(initial=0) >= asked * LEAST_GROUND:
        best = int(np.argmax(np.where(along > ALONG, score, 0)))
        # the axis need not be exact: it may be a tilted copy of a better one
        best = int(np.argmax(np.where(np.abs(normals @ normals[best]) > ALONG, score, 0)))
    others = score[np.abs(normals @ normals[best]) < ALONG].max(initial=0)
    upright = abs(normals[best, 2]) > ALONG and bool(score[best] >= CLEARLY * others)
    return best, upright or (up is not None and up.told)
