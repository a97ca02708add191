"""The map as one cloud: the surfaces of all keyframes, where the graph has them."""
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..core.common import se3
from ..core.compact_scan import CompactScan
from ..core.scan.labels import UNLABELLED
from .keyframe import Keyframes
from .pose_graph import PoseGraph

Array = NDArray[np.float64]


def map_cloud(keyframes: Keyframes, graph: PoseGraph
              ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return points (N, 3), metres in the map frame, and their classes inside (N,).

    Only of the part of the map that holds the first scan; what can move is left out.
    """
    part = graph.part(graph.nodes[0]) if len(graph) else 0
    return joined_cloud((graph.pose(one.id), one.scan) for one in keyframes
                        if graph.part(one.id) == part)


def joined_cloud(scans: Iterable[tuple[Array, CompactScan]]
                 ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return the same of scans with their T_map_sensor, (4, 4)."""
    clouds = [(T, *_cloud(scan)) for T, scan in scans]
    points = [se3.transform(T, cloud).astype(np.float32) for T, cloud, _ in clouds]
    return (np.concatenate([np.empty((0, 3), np.float32), *points]),
            np.concatenate([np.empty(0, np.uint8), *(labels for *_, labels in clouds)]))


def _cloud(scan: CompactScan) -> tuple[Array, NDArray[np.uint8]]:
    """Return the surface of a scan, with the classes of keypoints in the same voxel."""
    have, config = scan.arrays, scan.config.scaled(scan.scale)
    surface = have['surface_points'].astype(np.float64)
    labels = np.full(len(surface), UNLABELLED, np.uint8)
    if len(surface) and len(have['points']):
        distance, nearest = cKDTree(have['points']).query(surface)
        near = distance < config.voxel_size
        labels[near] = have['labels'][nearest[near]]
    return surface, labels
