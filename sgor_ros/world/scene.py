"""A labelled scene to cast rays at."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """A place with known geometry and classes.

    Attributes
    ----------
    raycaster : open3d.t.geometry.RaycastingScene
        One geometry per class, in the world frame, m.
    label_of_geometry : (G,) array of uint32
        Raw SemanticKITTI label of each geometry of the raycaster.
    """

    raycaster: o3d.t.geometry.RaycastingScene
    label_of_geometry: npt.NDArray[np.uint32]


def close(
    triangles: Mapping[int, Sequence[Array]],
    meshes: Mapping[int, tuple[Array, npt.NDArray[np.int64]]],
) -> tuple[o3d.t.geometry.RaycastingScene, npt.NDArray[np.uint32]]:
    """Make triangles ready for ray casting.

    Parameters
    ----------
    triangles : mapping of int to sequence of (K, 3, 3) array
        Loose triangles by label, m.
    meshes : mapping of int to ((V, 3) array, (K, 3) array)
        Vertices, m, and triangles by label.

    Returns
    -------
    raycaster : open3d.t.geometry.RaycastingScene
        One geometry per entry.
    label_of_geometry : (G,) array of uint32
        Their labels.
    """
    raycaster = o3d.t.geometry.RaycastingScene()
    labels = []
    for label, (vertices, faces) in meshes.items():
        _add(raycaster, vertices, faces)
        labels.append(label)
    for label, pieces in sorted(triangles.items()):
        corners = np.concatenate(pieces).reshape(-1, 3)
        _add(raycaster, corners, np.arange(len(corners)).reshape(-1, 3))
        labels.append(label)
    return raycaster, np.array(labels, np.uint32)


def _add(raycaster: o3d.t.geometry.RaycastingScene, vertices: Array,
         faces: npt.NDArray[np.int64]) -> None:
    raycaster.add_triangles(o3d.core.Tensor.from_numpy(vertices.astype(np.float32)),
                            o3d.core.Tensor.from_numpy(faces.astype(np.uint32)))
