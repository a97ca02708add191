"""The map as one cloud: the surfaces of all keyframes, where the graph has them."""
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..core.common import se3
from ..core.scan.labels import UNLABELLED
from .keyframe import Keyframe
from .keyframe import Keyframes
from .pose_graph import PoseGraph


def map_cloud(keyframes: Keyframes, graph: PoseGraph
              ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return points (N, 3), metres in the map frame, and their classes inside (N,).

    Only of the part of the map that holds the first scan; what can move is left out.
    """
    part = graph.part(graph.nodes[0]) if len(graph) else 0
    clouds = [(graph.pose(one.id), *_cloud(one)) for one in keyframes
              if graph.part(one.id) == part]
    points = [se3.transform(T, cloud).astype(np.float32) for T, cloud, _ in clouds]
    return (np.concatenate([np.empty((0, 3), np.float32), *points]),
            np.concatenate([np.empty(0, np.uint8), *(labels for *_, labels in clouds)]))


def _cloud(keyframe: Keyframe) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return the surface of a keyframe, with the classes of keypoints in the same voxel."""
    have, config = keyframe.scan.arrays, keyframe.scan.config.scaled(keyframe.scan.scale)
    surface = have['surface_points'].astype(np.float64)
    labels = np.full(len(surface), UNLABELLED, np.uint8)
    if len(surface) and len(have['points']):
        distance, nearest = cKDTree(have['points']).query(surface)
        near = distance < config.voxel_size
        labels[near] = have['labels'][nearest[near]]
    return surface, labels
