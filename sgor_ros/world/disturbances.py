"""What spoils a scan: returns before a surface and behind it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .labels import UNLABELLED
from .rays import cast
from .rays import Rays
from .scene import Scene

Array = npt.NDArray[np.float64]
Labels = npt.NDArray[np.uint32]

_NEAREST = 1.0  # m; nearer flakes are blanked by the sensor
_OFF = 1e-3  # m, so that a mirrored ray does not meet its mirror again


def early_returns(reach: Array, labels: Labels, share: float, limits: tuple[float, float],
                  rng: np.random.Generator) -> tuple[Array, Labels]:
    """Let a share of the rays return early, as in rain, dust or snow.

    Parameters
    ----------
    reach : (R,) array
        Range of each ray, m; infinite where it meets nothing, there it returns as well.
    labels : (R,) array
        Label of each.
    share : float
        Of the rays that return early, each anywhere between 1 m and its range.
    limits : (float, float)
        Least and greatest range of the sensor, m.
    rng : numpy.random.Generator
        Source of chance.

    Returns
    -------
    (R,) array, (R,) array
        Range and label; that of an early return is 0, unlabelled.
    """
    near, far = max(_NEAREST, limits[0]), np.minimum(reach, limits[1])
    early = (rng.random(len(reach)) < share) & (far > near)
    drops = near + rng.random(len(reach)) * (far - near)
    return np.where(early, drops, reach), np.where(early, np.uint32(UNLABELLED), labels)


def ghosts(scene: Scene, rays: Rays, reach: Array, labels: Labels, normals: Array, share: float,
           rng: np.random.Generator) -> tuple[Array, Labels]:
    """Let a share of the rays be mirrored by the surface that they meet.

    Parameters
    ----------
    scene : Scene
        Where they go on.
    rays : Rays
        In the frame of the scene.
    reach : (R,) array
        Range of each ray, m; infinite where it meets nothing.
    labels : (R,) array
        Label of each.
    normals : (R, 3) array
        Unit normal of the surface that each meets, to either side.
    share : float
        Of the rays that are mirrored.
    rng : numpy.random.Generator
        Source of chance.

    Returns
    -------
    (R,) array, (R,) array
        Range, longer by the way behind the mirror and infinite where that meets nothing, and the
        label of what is seen in it.
    """
    mirrored = np.flatnonzero((rng.random(len(reach)) < share) & np.isfinite(reach))
    ahead, normal = rays.directions[mirrored], normals[mirrored]
    back = ahead - 2 * np.sum(ahead * normal, axis=1, keepdims=True) * normal
    origins = np.broadcast_to(rays.origins, rays.directions.shape)[mirrored]
    mirror = origins + reach[mirrored, None] * ahead
    more, seen, _ = cast(scene, Rays(mirror + _OFF * back, back))
    reach, labels = reach.copy(), labels.copy()
    reach[mirrored] += _OFF + more
    labels[mirrored] = seen
    return reach, labels
