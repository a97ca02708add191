"""Rays and what they meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import open3d as o3d

from .scene import Scene

Array = npt.NDArray[np.float64]


class Rays(NamedTuple):
    """Rays in the frame of a scene.

    Attributes
    ----------
    origins : (3,) or (R, 3) array
        Where they start, m; one for all or each its own.
    directions : (R, 3) array
        Unit vectors.
    """

    origins: Array
    directions: Array


def cast(scene: Scene, rays: Rays) -> tuple[Array, npt.NDArray[np.uint32], Array]:
    """Find range (R,), m, infinite for a miss, label (R,) and normal (R, 3) of what rays meet."""
    lines = np.empty((len(rays.directions), 6), np.float32)
    lines[:, :3] = rays.origins
    lines[:, 3:] = rays.directions
    hits = scene.raycaster.cast_rays(o3d.core.Tensor.from_numpy(lines))
    geometry = hits['geometry_ids'].numpy()
    # The id of a miss is out of range; its label is never used.
    geometry = np.minimum(geometry, len(scene.label_of_geometry) - 1)
    return (hits['t_hit'].numpy().astype(np.float64), scene.label_of_geometry[geometry],
            hits['primitive_normals'].numpy().astype(np.float64))
