"""Long walls, tubes and bands: what goes on and on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..shapes import from_quads
from ..shapes import place
from ..shapes import relief

Array = npt.NDArray[np.float64]

_PIECE = 5.0  # m, so that no triangle is a sliver


def extrude(profile: npt.ArrayLike, start: float, end: float) -> Array:
    """Draw a profile (P, 2) of y and z, m, along x from start to end, m; triangles (K, 3, 3)."""
    yz = np.asarray(profile, float)
    x = np.linspace(start, end, max(1, round((end - start) / _PIECE)) + 1)
    line = np.stack([np.column_stack([np.full(len(yz), k), yz]) for k in x])
    quads = np.stack([line[:-1, :-1], line[1:, :-1], line[1:, 1:], line[:-1, 1:]], axis=2)
    return from_quads(quads.reshape(-1, 4, 3))


def niches(begins: Array, ends: Array, low: float, high: float, depths: Array,
           span: tuple[float, float], top: float) -> Array:
    """Wall along x with recesses, seen from +y, its face on y = 0.

    Parameters
    ----------
    begins, ends : (N,) array
        Where each recess begins and ends along the wall, in order, m.
    low, high : float
        Heights between which they are, m.
    depths : (N,) array
        How deep they go, m; negative ones stand out.
    span : tuple of float
        Ends of the wall, m.
    top : float
        Its height, m; its foot is on z = 0.

    Returns
    -------
    (K, 3, 3) array
        Triangles, m.
    """
    u = np.concatenate([[span[0]], np.column_stack([begins, ends]).ravel(), [span[1]]])
    rows = np.array([0.0, low, high, top])
    heights, where = np.unique(rows, return_index=True)
    depth = np.zeros((len(u) - 1, len(heights) - 1))
    depth[1::2, int(np.flatnonzero(where == list(rows).index(low))[0])] = -np.asarray(depths)
    return relief(u, heights, depth)


def facing_left(wall: Array, y: float) -> Array:
    """Move a wall seen from +y to y, m: it is on the right and faces left."""
    return place(wall, (0.0, y, 0.0))


def facing_right(wall: Array, y: float) -> Array:
    """Turn a wall seen from +y about and move it to y, m: it is on the left, x runs back."""
    return place(wall, (0.0, y, 0.0), np.pi)
