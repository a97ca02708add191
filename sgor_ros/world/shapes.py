"""Solids as loose triangles: arrays (K, 3, 3) of K triangles, 3 corners, x y z in m."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
import open3d as o3d

Array = npt.NDArray[np.float64]
Rectangle = tuple[float, float, float, float]


def from_quads(quads: Array) -> Array:
    """Split quads (Q, 4, 3) into triangles (K, 3, 3), without those that have no area."""
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(triangles[np.linalg.norm(normal, axis=1) > 1e-9])


def frustum(bottom: Rectangle, top: Rectangle, low: float, high: float) -> Array:
    """Solid between two level rectangles.

    Parameters
    ----------
    bottom, top : tuple of float
        Rectangles as (x min, x max, y min, y max), m.
    low, high : float
        Their heights, m.

    Returns
    -------
    (K, 3, 3) array
        Triangles, m.
    """
    corners = np.array([
        [(r[i], r[j], z) for i, j in ((0, 2), (1, 2), (1, 3), (0, 3))]
        for r, z in ((bottom, low), (top, high))
    ]).reshape(8, 3)
    faces = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    return from_quads(corners[faces])


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Array:
    """Upright box by its ranges in x, y and z, m; triangles (K, 3, 3)."""
    return frustum((*x, *y), (*x, *y), *z)


def tube(start: npt.ArrayLike, end: npt.ArrayLike, radii: tuple[float, float],
         sides: int = 8) -> Array:
    """Tapered round bar with closed ends.

    Parameters
    ----------
    start, end : (3,) array_like
        Ends of its axis, m.
    radii : tuple of float
        Radius at either end, m.
    sides : int
        Corners of its cross-section.

    Returns
    -------
    (K, 3, 3) array
        Triangles, m.
    """
    a, b = np.asarray(start, float), np.asarray(end, float)
    axis = (b - a) / np.linalg.norm(b - a)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, 2 * np.pi, sides + 1)[:, None]
    circle = np.cos(angle) * across + np.sin(angle) * np.cross(axis, across)
    low, high = a + radii[0] * circle, b + radii[1] * circle
    wall = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)
    caps = [np.stack([ring[:-1], ring[1:], np.broadcast_to(middle, (sides, 3))], axis=1)
            for ring, middle in ((low, a), (high, b))]
    return np.concatenate([from_quads(wall), *caps])


@lru_cache
def _sphere(divisions: int) -> tuple[Array, npt.NDArray[np.int64]]:
    mesh = o3d.geometry.TriangleMesh.create_icosahedron().subdivide_midpoint(divisions)
    vertices = np.asarray(mesh.vertices)
    return (vertices / np.linalg.norm(vertices, axis=1, keepdims=True),
            np.asarray(mesh.triangles).astype(np.int64))


def blob(rng: np.random.Generator, radii: npt.ArrayLike, bulge: float = 1.0,
         roughness: float = 0.12, holes: float = 0.25, divisions: int = 2) -> Array:
    """Ragged, leaky ball around the origin, for leaves.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of chance.
    radii : (3,) array_like
        Half extent in x, y and z, m.
    bulge : float
        1 for an ellipsoid, towards 0 for a box.
    roughness : float
        Standard deviation of the radius, as a share of it.
    holes : float
        Share of its surface left open.
    divisions : int
        Fineness: 20 * 4**divisions triangles before the holes.

    Returns
    -------
    (K, 3, 3) array
        Triangles, m.
    """
    sphere, faces = _sphere(divisions)
    radius = 1.0 + roughness * rng.standard_normal((len(sphere), 1))
    shaped = np.sign(sphere) * np.abs(sphere) ** bulge
    vertices = radius * shaped * np.asarray(radii, float)
    return np.asarray(vertices[faces[rng.random(len(faces)) >= holes]])


def relief(u: Array, v: Array, depth: Array) -> Array:
    """Wall of flat panels that stand forward or back, with the reveals between them.

    Parameters
    ----------
    u : (U + 1,) array
        Borders of the panels along the wall (x), m.
    v : (V + 1,) array
        Borders of the panels in height (z), m.
    depth : (U, V) array
        How far each panel stands out (y), m.

    Returns
    -------
    (K, 3, 3) array
        Triangles, m.
    """
    i, j = (index.ravel() for index in np.indices(depth.shape))
    panels = _corners((u[i], u[i + 1], u[i + 1], u[i]), depth[i, j],
                      (v[j], v[j], v[j + 1], v[j + 1]))
    i, j = (index.ravel() for index in np.indices((depth.shape[0] - 1, depth.shape[1])))
    here, there = depth[i, j], depth[i + 1, j]
    upright = _corners(u[i + 1], (here, there, there, here), (v[j], v[j], v[j + 1], v[j + 1]))
    i, j = (index.ravel() for index in np.indices((depth.shape[0], depth.shape[1] - 1)))
    here, there = depth[i, j], depth[i, j + 1]
    level = _corners((u[i], u[i], u[i + 1], u[i + 1]), (here, there, there, here), v[j + 1])
    return from_quads(np.concatenate([panels, upright, level]))


def _corners(*axes: Array | tuple[Array, ...]) -> Array:
    """Quads (Q, 4, 3); an axis is given per corner, or once for all four."""
    full = [axis if isinstance(axis, tuple) else (axis,) * 4 for axis in axes]
    return np.asarray(np.array(full).transpose(2, 1, 0))


def place(triangles: Array, position: npt.ArrayLike, yaw: float = 0.0) -> Array:
    """Turn triangles (K, 3, 3) by yaw (rad) about z, then move them by position (3,), m."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(triangles @ turn.T + np.asarray(position, float))
