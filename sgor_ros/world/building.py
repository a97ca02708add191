"""One house: facades with niches, bays and balconies, and a roof."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .shapes import box
from .shapes import from_quads
from .shapes import place
from .shapes import relief

Array = npt.NDArray[np.float64]

_FOOTING = -1.5  # m, walls reach below sloped ground
_SILL = 0.85  # m above the floor
_LINTEL = 2.25  # m above the floor


def house(rng: np.random.Generator, width: float, depth: float, storeys: int) -> Array:
    """Draw a house.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of chance.
    width, depth : float
        Extent along the street (x) and away from it (-y), m.
    storeys : int
        Number of floors.

    Returns
    -------
    (K, 3, 3) array
        Triangles, m; the middle of the front is the origin, the street lies at +y.
    """
    ground, upper = rng.uniform(2.9, 3.8), rng.uniform(2.6, 3.1)
    floors = np.concatenate([[0.0], ground + upper * np.arange(storeys)])
    half = width / 2
    parts = [
        _front(rng, width, floors),
        place(_plain_wall(rng, width, floors), (0.0, -depth, 0.0), np.pi),
        place(_plain_wall(rng, depth, floors), (half, -depth / 2, 0.0), -np.pi / 2),
        place(_plain_wall(rng, depth, floors), (-half, -depth / 2, 0.0), np.pi / 2),
        _roof(rng, width, depth, float(floors[-1])),
    ]
    if rng.random() < 0.4:
        parts.append(_extension(rng, width, depth))
    return np.concatenate(parts)


def house_front(rng: np.random.Generator, width: float, storeys: int) -> Array:
    """Draw the front of a house only, as `house` does; triangles (K, 3, 3), m."""
    ground, upper = rng.uniform(2.9, 3.8), rng.uniform(2.6, 3.1)
    return _front(rng, width, np.concatenate([[0.0], ground + upper * np.arange(storeys)]))


def _heights(floors: Array) -> Array:
    """Panel borders in height: footing, then sill, lintel and ceiling of each storey."""
    rows = [[floor + _SILL, floor + _LINTEL, ceiling]
            for floor, ceiling in pairwise(floors)]
    return np.concatenate([[_FOOTING, 0.0], np.ravel(rows)])


def _bays(rng: np.random.Generator, length: float) -> Array:
    """Panel borders along a wall: pier, opening, pier, opening, ..., pier."""
    count = max(1, round(length / rng.uniform(2.3, 3.6)))
    pitch = length / count
    middle = (np.arange(count) + 0.5) * pitch - length / 2
    opening = pitch * rng.uniform(0.32, 0.62, count) / 2
    borders = np.column_stack([middle - opening, middle + opening]).ravel()
    return np.concatenate([[-length / 2], borders, [length / 2]])


def _plain_wall(rng: np.random.Generator, length: float, floors: Array) -> Array:
    u, v = _bays(rng, length), _heights(floors)
    depth = np.zeros((len(u) - 1, len(v) - 1))
    windows = rng.random((len(u) // 2 - 1, len(floors) - 1)) < 0.45
    depth[1::2, 2::3] = -0.18 * windows
    return relief(u, v, depth)


def _front(rng: np.random.Generator, width: float, floors: Array) -> Array:
    """Street front: windows, a door, now and then bays, a shop or balconies."""
    u, v = _bays(rng, width), _heights(floors)
    count = len(u) // 2 - 1
    depth = np.zeros((len(u) - 1, len(v) - 1))
    depth[:, :2] = rng.uniform(0.0, 0.12)  # plinth
    depth[:, 4::3] = rng.choice([0.0, 0.1])  # string courses
    parts = []
    if rng.random() < 0.45:
        for bay in rng.choice(count, max(1, count // 3), replace=False):
            depth[2 * bay:2 * bay + 3] += rng.uniform(0.4, 1.0)
    depth[1::2, 2::3] -= rng.uniform(0.1, 0.35)
    if rng.random() < 0.25:  # shop windows
        depth[1::2, 1:3] = -rng.uniform(0.25, 0.7)
    door = 2 * int(rng.integers(count)) + 1
    depth[door, 1:3] = -rng.uniform(0.4, 1.3)
    parts.append(relief(u, v, depth))
    if rng.random() < 0.6:
        parts.append(_steps(rng, u[door], u[door + 1], float(depth[door - 1, 1])))
    if len(floors) > 2 and rng.random() < 0.5:
        reach = rng.uniform(0.9, 1.5)
        for bay in np.flatnonzero(rng.random(count) < 0.6):
            span = (u[2 * bay + 1] - 0.4, u[2 * bay + 2] + 0.4)
            for floor in floors[1:-1]:
                parts.append(box(span, (0.0, reach), (floor - 0.15, floor)))
                parts.append(box(span, (reach - 0.06, reach), (floor, floor + 1.0)))
    return np.concatenate(parts)


def _steps(rng: np.random.Generator, left: float, right: float, out: float) -> Array:
    """Build steps before a door, sometimes under a porch."""
    tread = rng.uniform(0.28, 0.4)
    parts = [box((left - 0.2, right + 0.2), (-0.3, out + tread * k), (_FOOTING, 0.54 - 0.18 * k))
             for k in (1, 2)]
    if rng.random() < 0.5:
        parts.append(box((left - 0.5, right + 0.5), (0.0, 1.1), (2.45, 2.6)))
        parts += [box((x - 0.08, x + 0.08), (0.9, 1.06), (_FOOTING, 2.45))
                  for x in (left - 0.4, right + 0.4)]
    return np.concatenate(parts)


def _roof(rng: np.random.Generator, width: float, depth: float, eaves: float) -> Array:
    half, over = width / 2, rng.uniform(0.15, 0.5)
    if rng.random() < 0.3:  # flat, with a parapet
        return box((-half, half), (-depth, 0.0), (eaves, eaves + rng.uniform(0.4, 0.9)))
    pitch = np.tan(rng.uniform(0.5, 0.8))
    if rng.random() < 0.6:  # eaves to the street
        roof = place(_gable(depth / 2, half, over, pitch), (0.0, -depth / 2, eaves), np.pi / 2)
    else:
        roof = place(_gable(half, depth / 2, over, pitch), (0.0, -depth / 2, eaves))
    x, top = rng.uniform(-half + 1.0, half - 1.0), eaves + pitch * min(half, depth / 2) + 0.6
    chimney = box((x - 0.35, x + 0.35), (-depth * 0.6, -depth * 0.6 + 0.6), (eaves, top))
    return np.concatenate([roof, chimney])


def _gable(span: float, length: float, over: float, pitch: float) -> Array:
    """Ridge roof along y, half span in x, half length in y, eaves at z = 0."""
    ridge, drop, reach = pitch * span, -pitch * over, length + over
    quads = [[(side * (span + over), -reach, drop), (side * (span + over), reach, drop),
              (0.0, reach, ridge), (0.0, -reach, ridge)] for side in (-1, 1)]
    quads += [[(-span, y, 0.0), (span, y, 0.0), (0.0, y, ridge), (0.0, y, ridge)]
              for y in (-length, length)]
    return from_quads(np.array(quads))


def _extension(rng: np.random.Generator, width: float, depth: float) -> Array:
    """Low annexe at the back."""
    left = rng.uniform(-width / 2, 0.0)
    span = (left, left + rng.uniform(0.3, 0.5) * width)
    back = -depth - rng.uniform(2.0, 4.5)
    return box(span, (back, -depth), (_FOOTING, rng.uniform(2.4, 3.2)))
