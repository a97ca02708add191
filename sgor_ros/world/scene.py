"""A small labelled street scene to cast rays at."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

from .frontage import build_up
from .frontage import furnish
from .frontage import park_cars
from .frontage import plant
from .layout import Layout
from .layout import make_layout
from .site import Site

Array = npt.NDArray[np.float64]

_SCATTERED = 250  # attempts at a plant in yards and on spare land


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


@dataclass(frozen=True)
class StreetScene(Scene):
    """A street with houses.

    Attributes
    ----------
    layout : Layout
        Where the streets run and how high the ground is.
    """

    layout: Layout


def street_scene(seed: int = 0) -> StreetScene:
    """Build a place: a loop road with side streets, houses and all that lines them.

    Parameters
    ----------
    seed : int
        Each seed gives another place; the same seed gives the same place.

    Returns
    -------
    StreetScene
        Its triangles by class, ready for ray casting.
    """
    rng = np.random.default_rng(seed)
    layout = make_layout(rng)
    site = Site(layout, rng)
    for street in layout.streets:
        for side in (-1, 1):
            build_up(site, street, side)
            furnish(site, street, side)
            park_cars(site, street, side)
    for spot in rng.uniform(*layout.bounds, (_SCATTERED, 2)):
        plant(site, spot)

    return StreetScene(*close(site.triangles, site.pave()), layout)


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
