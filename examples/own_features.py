"""Features of your own, learned ones such as FCGF, in place of voxels with FPFH.

Labels, ground, verification and the verdict stay those of the package.
"""
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sgor_ros import PreparedScan
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import Registration
from sgor_ros import SemanticScan
from sgor_ros.world import simulate

RADII_M = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)


def describe(points: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stand in for your network: keypoints (V, 3), metres, and descriptors (V, D), any D.

    Here: one point a voxel, and how its surroundings spread, in three radii and three directions.
    """
    _, first = np.unique((points / 0.5).astype(int), axis=0, return_index=True)
    keypoints = points[first].astype(np.float64)
    tree = cKDTree(keypoints)
    described = []
    for near in (tree.query_ball_point(keypoints, radius) for radius in RADII_M):
        spread = np.array([np.linalg.eigvalsh(np.cov(keypoints[rows].T)) if len(rows) > 3
                           else np.zeros(3) for rows in near])
        height = np.array([np.ptp(keypoints[rows, 2]) for rows in near])
        described.append(np.column_stack((np.sqrt(np.maximum(spread, 0)), height)))
    return keypoints, np.hstack(described)


def prepared(points: NDArray[np.float32], labels: NDArray[np.uint32]) -> PreparedScan:
    """Prepare a scan with your keypoints and descriptors."""
    keypoints, descriptors = describe(points)
    return preprocess(SemanticScan(points, labels), keypoints=keypoints, descriptors=descriptors)


def main() -> Registration:
    """Register two scans by them."""
    scans = list(simulate(2, seed=0, speed=40.0))
    target, source = (prepared(points, labels) for _, points, labels, _ in scans)
    result = register(source, target)
    print('registered' if result.success else result.reason, f'{result.confidence:.2f}')
    return result


if __name__ == '__main__':
    main()
