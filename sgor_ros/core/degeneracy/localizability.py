"""Localizability: how much the surfaces hold each direction (point-to-plane information).

Normals of surfaces that face no way along a direction cannot hold it: the eigenvalues of the
information matrix, as in Zhang 2016 and X-ICP. Noise of the normals blurs the smallest of them, so
a weak direction is tried by the perturbation test.
"""
import numpy as np
from numpy.typing import NDArray

from ..common.products import scatter
from ..common.products import times_transposed
from ..icp.point_to_plane import partners
from ..index.scan_index import ScanIndex

KEYPOINTS = 1000
"""Keypoints behind the information matrix."""
WEAK = 0.1
"""A direction is tried when less than this share of the points, so to say, faces along it."""
GROUND_INFORMATION = 0.3
"""Share of the information that a ground plane seen by both scans adds to height, roll and pitch:
the keypoints are none of the ground."""


def information(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64]
                ) -> tuple[NDArray[np.float64], float]:
    """Return the point-to-plane information matrix of a pose and the typical lever.

    Returns
    -------
    (6, 6) float64
        Mean over the points that lie on a surface; (x, y, z, rotation about x, y, z) about the
        source's sensor in the target frame, rotations times the lever, so that all are metres.
    float
        Root mean square distance of the points from the sensor, metres.
    """
    rows, at = partners(source, target, T_target_source, KEYPOINTS)
    if not len(rows):
        return np.zeros((6, 6)), 1.0
    arms = times_transposed(source.points[rows], T_target_source[:3, :3])
    lever = float(np.sqrt((arms**2).sum(axis=1).mean()))
    normals = target.normals[at]
    jacobian = np.hstack((normals, np.cross(arms, normals) / lever))
    matrix = scatter(jacobian) / len(rows)
    if source.level and target.level:
        x, y, up = target.axes
        for direction in (np.r_[up, 0, 0, 0], np.r_[0, 0, 0, x], np.r_[0, 0, 0, y]):
            matrix += GROUND_INFORMATION * np.outer(direction, direction)
    return matrix, lever


def weak_directions(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64]
                    ) -> tuple[NDArray[np.float64], float]:
    """Return twists (K, 6) of one metre along which the surfaces hold little, and the lever.

    Returns
    -------
    (K, 6) float64
        About the source's sensor in the target frame, weakest first.
    float
        Metres, see `information`.
    """
    matrix, lever = information(source, target, T_target_source)
    values, vectors = np.linalg.eigh(matrix)
    twists = vectors[:, values < WEAK].T
    twists[:, 3:] /= lever
    return twists, lever
