"""Secondary ground segmentation (Sec. III-B, Eq. 2 and 3; normal by Eq. 16)."""
from dataclasses import dataclass
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..common.products import scatter
from ..common.products import times_transposed
from ..common.products import times_vector
from ..config import SgorConfig
from .voxels import VoxelCloud

TRIALS, SAMPLE, SEED = 200, 1000, 0
"""Planes tried by RANSAC, and points asked about each."""

UPRIGHT, LEAST_GROUND = np.cos(np.radians(30.0)), 0.05
"""A plane across the sensor's z axis, by this cosine, is the ground before any wall or ceiling is,
if it holds this share of the points near the sensor."""


@dataclass(frozen=True)
class Ground:
    """The ground plane of one scan: points x on it have ``normal @ x + offset = 0``.

    Attributes
    ----------
    normal : (3,) float64
        Unit normal n, towards the sensor.
    offset : float
        Height of the sensor over the plane, metres.
    mask : (V,) bool
        Which voxels are ground.
    source : {'labels', 'geometry'}
        Where the first guess of the ground came from.
    """

    normal: NDArray[np.float64]
    offset: float
    mask: NDArray[np.bool_]
    source: Literal['labels', 'geometry']

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed distance of each point over the plane, (N,) metres."""
        return times_vector(points, self.normal) + self.offset


def segment_ground(cloud: VoxelCloud, ground_classes: frozenset[int],
                   config: SgorConfig) -> Ground | None:
    """Find the ground by labels, plane by consensus, distance to it, and plane again.

    Returns
    -------
    Ground or None
        None where neither labels nor geometry show a ground plane.
    """
    by_label = np.isin(cloud.labels, list(ground_classes))
    if by_label.sum() >= config.min_ground_points:
        return _by_labels(cloud.points, by_label, config)
    return _by_geometry(cloud.points, config)


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


def _by_labels(points: NDArray[np.float64], by_label: NDArray[np.bool_],
               config: SgorConfig) -> Ground | None:
    if not config.secondary_ground:
        return Ground(*fit_plane(points[by_label]), by_label, 'labels')
    # wrong labels and far slopes would tilt the first plane
    near = np.linalg.norm(points, axis=1) < config.ground_radius
    seed = by_label & near if (by_label & near).sum() >= config.min_ground_points else by_label
    ground = _by_consensus(points, points[seed], 'labels', config)
    if ground is not None and config.labelled_ground:
        ground = replace(ground, mask=ground.mask & by_label)
    return ground


def _by_geometry(points: NDArray[np.float64], config: SgorConfig) -> Ground | None:
    near = points[np.linalg.norm(points, axis=1) < config.ground_radius]
    if len(near) < config.min_ground_points:
        return None
    return _by_consensus(points, near, 'geometry', config)


def _by_consensus(points: NDArray[np.float64], candidates: NDArray[np.float64],
                  source: Literal['labels', 'geometry'], config: SgorConfig) -> Ground | None:
    """Find the plane through most candidates that has next to nothing below it (RANSAC)."""
    rng = np.random.default_rng(SEED)
    corners = candidates[rng.integers(len(candidates), size=(TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    offsets = -np.einsum('ij,ij->i', normals, corners[:, 0])
    flip = offsets < 0
    normals[flip], offsets[flip] = -normals[flip], -offsets[flip]
    sample = candidates[::max(len(candidates) // SAMPLE, 1)]
    heights = times_transposed(sample, normals) + offsets
    # what lies below a wall or a table plane tells it from the ground
    score = ((np.abs(heights) < config.sigma_g).sum(axis=0)
             - 3 * (heights < -2 * config.sigma_g).sum(axis=0))
    score[length[:, 0] == 0] = 0
    upright = normals[:, 2] > UPRIGHT
    if source == 'geometry' and score[upright].max(initial=0) >= len(sample) * LEAST_GROUND:
        score[~upright] = 0
    best = int(np.argmax(score))
    normal, offset = normals[best], float(offsets[best])
    near = np.abs(times_vector(candidates, normal) + offset) < config.sigma_g
    if score[best] <= 0 or near.sum() < config.min_ground_points:
        return None
    for _ in range(2):
        normal, offset = fit_plane(candidates[near])
        near = np.abs(times_vector(candidates, normal) + offset) < config.sigma_g
        if near.sum() < config.min_ground_points:
            return None
    return Ground(normal, offset, np.abs(times_vector(points, normal) + offset) < config.sigma_g,
                  source)
