"""The building site: collects triangles by class and knows which land is taken."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import numpy.typing as npt

from ..labels import FENCE
from ..labels import ROAD
from ..labels import SIDEWALK
from ..labels import TERRAIN
from ..objects import Parts
from ..shapes import from_quads
from ..shapes import place
from .layout import Layout

Array = npt.NDArray[np.float64]

_CELL = 0.5  # m, of the map of taken land
_GROUND_CELL = 0.3  # m, of the ground mesh


class Site:
    """Where things are put, before the scene is closed.

    Parameters
    ----------
    layout : Layout
        Streets and relief.
    rng : numpy.random.Generator
        Source of chance for everything that is put here.
    """

    def __init__(self, layout: Layout, rng: np.random.Generator) -> None:
        self.layout = layout
        self.rng = rng
        self.triangles: defaultdict[int, list[Array]] = defaultdict(list)
        self._low, self._high = layout.bounds
        self._taken = np.zeros(np.ceil((self._high - self._low) / _CELL).astype(int) + 1, bool)

    def inside(self, xy: Array, margin: float = 1.0) -> bool:
        """Whether all points (N, 2), m, lie on the land."""
        return bool(np.all((xy > self._low + margin) & (xy < self._high - margin)))

    def claim(self, xy: Array) -> bool:
        """Take the land at points (N, 2), m, unless some of it is taken or outside."""
        if not self.inside(xy):
            return False
        i, j = ((xy - self._low) / _CELL).astype(int).T
        if self._taken[i, j].any():
            return False
        self._taken[i, j] = True
        return True

    def height(self, xy: Array) -> float:
        """Height of the ground at a point (2,), m."""
        return float(self.layout.ground_height(xy[None])[0])

    def put(self, parts: Parts, xy: Array, yaw: float) -> None:
        """Stand labelled triangles on the ground at a point (2,), m, turned by yaw, rad."""
        position = (*xy, self.height(xy))
        for label, triangles in parts:
            self.triangles[label].append(place(triangles, position, yaw))

    def fence(self, start: Array, end: Array) -> None:
        """Run pickets or a low wall from start to end, (2,) each, m, along the ground."""
        wall = self.rng.random() < 0.3
        pitch = 0.8 if wall else 0.16
        count = max(2, round(float(np.linalg.norm(end - start)) / pitch))
        step = (end - start) / count
        posts = start + np.arange(count)[:, None] * step
        thickness = 0.24 * np.array([-step[1], step[0]]) / np.linalg.norm(step)
        top = self.rng.uniform(0.7, 1.3) + self.rng.normal(0.0, 0.02, count)
        ground = self.layout.ground_height(posts)
        if wall:
            front = _upright(posts, step, ground - 0.4, ground + top)
            back = _upright(posts + thickness, step, ground - 0.4, ground + top)
            lid = np.stack([front[:, 3], front[:, 2], back[:, 2], back[:, 3]], axis=1)
            quads = [front, back, lid]
        else:
            quads = [_upright(posts, 0.6 * step, ground + 0.05, ground + top)]
            quads += [_upright(posts, step, ground + z, ground + z + 0.08) for z in (0.25, 0.6)]
        self.triangles[FENCE].append(from_quads(np.concatenate(quads)))

    def pave(self) -> dict[int, tuple[Array, npt.NDArray[np.int64]]]:
        """Make the ground.

        Returns
        -------
        dict of int to ((V, 3) array, (K, 3) array)
            Vertices, m, and triangles by label: road, sidewalk, terrain.
        """
        x, y = (np.arange(a, b, _GROUND_CELL)
                for a, b in zip(self._low, self._high, strict=True))
        xy = np.stack(np.meshgrid(x, y, indexing='ij'), axis=-1).reshape(-1, 2)
        kerb = self.layout.kerb_distance(xy)
        slope = np.stack(np.gradient(kerb.reshape(len(x), len(y)), _GROUND_CELL), axis=-1)
        for edge in (0.0, self.layout.sidewalk):
            # Pull near vertices on to the edge, or it would be a saw blade; half a cell's
            # diagonal is near enough that no triangle straddles it.
            near = np.abs(kerb - edge) < 0.71 * _GROUND_CELL
            xy[near] -= (kerb[near] - edge)[:, None] * slope.reshape(-1, 2)[near]
            kerb[near] = edge
        z = self.layout.ground_height(xy, kerb)
        grass = np.clip(kerb - self.layout.sidewalk, 0.0, 1.0)
        z += self.rng.standard_normal(len(z)) * (0.003 + 0.025 * grass)
        vertices = np.column_stack([xy, z])
        index = np.arange(len(xy)).reshape(len(x), len(y))
        a, b, c, d = (index[i:len(x) - 1 + i, j:len(y) - 1 + j].ravel()
                      for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
        faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        middle = kerb[faces].mean(axis=1)
        zone = np.digitize(middle, [0.0, self.layout.sidewalk])
        return {label: (vertices, faces[zone == k])
                for k, label in enumerate((ROAD, SIDEWALK, TERRAIN))}


def _upright(start: Array, step: Array, low: Array, high: Array) -> Array:
    """Vertical quads (N, 4, 3) from start (N, 2) to start + step, between two heights (N,)."""
    end = start + step
    return np.stack([np.column_stack(corner) for corner in
                     ((start, low), (end, low), (end, high), (start, high))], axis=1)
