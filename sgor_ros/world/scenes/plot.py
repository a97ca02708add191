"""The plot of land that a scene is built on: triangles by class, and what stands where."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from ..objects import Parts
from ..shapes import from_quads
from ..shapes import place
from ..shapes import Rectangle

Array = npt.NDArray[np.float64]

_REACH = 2.6  # m above its foot, below which a thing is in the way of a sensor


class Plot:
    """Where a scene's things are put.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of chance for everything that is put here.
    path : (M, 2) array
        Where a sensor drives, m.
    height : callable, optional
        Height of the ground (N,), m, at points (N, 2), m; level if not given.
    """

    def __init__(self, rng: np.random.Generator, path: Array,
                 height: Callable[[Array], Array] | None = None) -> None:
        self.rng = rng
        self.path = path
        self.height = height or (lambda xy: np.zeros(len(xy)))
        self.triangles: defaultdict[int, list[Array]] = defaultdict(list)
        self._tree = cKDTree(path)
        self._boxes: list[Array] = []

    @property
    def boxes(self) -> Array:
        """What stands in the way: rows of x, y, yaw, x min, x max, y min, y max, (B, 7)."""
        return np.array(self._boxes).reshape(-1, 7)

    def add(self, label: int, triangles: Array) -> None:
        """Add triangles (K, 3, 3), m, where they are: walls, floors and the like."""
        self.triangles[label].append(triangles)

    def put(self, parts: Parts, xy: npt.ArrayLike, yaw: float = 0.0) -> None:
        """Stand labelled triangles on the ground at a point (2,), m, turned by yaw, rad."""
        spot = np.asarray(xy, float)
        foot = np.array([*spot, self.height(spot[None])[0]])
        low = []
        for label, triangles in parts:
            self.triangles[label].append(place(triangles, foot, yaw))
            low.append(triangles[triangles[:, :, 2].min(axis=1) < _REACH].reshape(-1, 3))
        corners = np.concatenate(low)
        if len(corners):
            ends = np.stack([corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)])
            self._boxes.append(np.array([*spot, yaw, *ends.T.ravel()]))

    def room(self, xy: npt.ArrayLike, radius: float, path_clear: float = 1.5) -> bool:
        """Whether nothing stands within a radius of a point (2,), nor on the path, all in m."""
        spot = np.asarray(xy, float)
        beside_path = float(self._tree.query(spot)[0]) > radius + path_clear
        return beside_path and bool(clear_of(self.boxes, spot[None], radius)[0])

    def floor(self, label: int, area: Rectangle, cell: float = 10.0) -> None:
        """Lay ground of a class on a rectangle (x min, x max, y min, y max), m, in cells."""
        x, y = (np.linspace(a, b, max(1, round((b - a) / cell)) + 1)
                for a, b in (area[:2], area[2:]))
        xy = np.stack(np.meshgrid(x, y, indexing='ij'), axis=-1)
        corners = np.concatenate([xy, self.height(xy.reshape(-1, 2)).reshape(
            *xy.shape[:2], 1)], axis=-1)
        quads = np.stack([corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:],
                          corners[:-1, 1:]], axis=2)
        self.add(label, from_quads(quads.reshape(-1, 4, 3)))


def clear_of(boxes: Array, xy: Array, radius: float) -> npt.NDArray[np.bool_]:
    """Whether points (N, 2) are farther than a radius, m, from all boxes (B, 7); (N,)."""
    away = xy[:, None] - boxes[:, :2]
    cos, sin = np.cos(boxes[:, 2]), np.sin(boxes[:, 2])
    local = np.stack([cos * away[..., 0] + sin * away[..., 1],
                      cos * away[..., 1] - sin * away[..., 0]], axis=-1)
    nearest = np.clip(local, boxes[:, 3::2], boxes[:, 4::2])
    return np.asarray((np.linalg.norm(local - nearest, axis=-1) > radius).all(axis=1))
