"""What one scan can say about points of another: where its points are, and how far it saw."""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.angles import atan2
from ..scan.columns import Columns
from ..scan.columns import in_columns
from ..scan.features import Features

AZIMUTHS, ELEVATIONS = 360, 180
"""Cells of the range image: 1 degree, wider than the gaps between beams."""
SECTORS = 8
"""Directions that a surface can face in the overhead map, beside up and down."""
KINDS = 7
"""Classes and heights that the overhead map tells apart for each direction: 9 times 7 bits."""
FACES_UP = 0.7
"""A surface lies rather than stands from this share of its unit normal upwards."""


@dataclass(frozen=True, eq=False)
class OverheadMap:
    """What stands in each cell of the ground plane, seen from above, and which way it faces.

    Attributes
    ----------
    cells : (M, M) uint64
        One bit for each way that a keypoint in the cell or next to it faces, roughly, together
        with its class and height, of which several share a bit.
    edge : float
        Edge of a cell, metres.
    low : float
        Lower border of the map along both axes, metres.
    """

    cells: NDArray[np.uint64]
    edge: float
    low: float


@dataclass(frozen=True, eq=False)
class View:
    """What one scan can say about points of another.

    Attributes
    ----------
    points, normals : (V, 3) float64
        Keypoints, metres, and their unit normals.
    labels : (V,) uint8
        Their regional labels.
    reach : float
        Farthest partner of a point that counts, metres.
    columns : Columns
        The keypoints in columns, with
    column_normals, column_labels : (V, 3) float64, (V,) uint8
        Normals and labels in their order.
    nearest : (360, 180) float32
        Shortest range measured in each direction or next to it, metres; infinite where nothing
        was.
    axes : (3, 3) float64
        Two axes of the ground plane and the direction up, as rows.
    level : bool
        Whether a ground plane says what is up; without, it is the sensor's z axis.
    overhead : OverheadMap
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    labels: NDArray[np.uint8]
    reach: float
    columns: Columns
    column_normals: NDArray[np.float64]
    column_labels: NDArray[np.uint8]
    nearest: NDArray[np.float32]
    axes: NDArray[np.float64]
    level: bool
    overhead: OverheadMap


def view(nearest: NDArray[np.float32], features: Features, normals: NDArray[np.float64],
         up: NDArray[np.float64] | None, reach: float) -> View:
    """Prepare what one scan can say.

    Parameters
    ----------
    nearest : (360, 180) float32
        The `range_image` of the scan.
    features : Features
        Its keypoints.
    normals : (V, 3) float64
        Their unit normals.
    up : (3,) float64 or None
        Unit normal of the ground; None without a ground plane.
    reach : float
        Farthest partner of a keypoint that counts, metres.
    """
    columns = in_columns(features.points, reach)
    axes = np.eye(3) if up is None else np.vstack((np.linalg.svd(up[None])[2][1:], up))
    return View(features.points, normals, features.regional, reach, columns,
                normals[columns.order], features.regional[columns.order],
                nearest, axes, up is not None,
                _overhead(features.points @ axes.T, normals @ axes.T, features.regional, reach))


def _overhead(placed: NDArray[np.float64], facing: NDArray[np.float64],
              labels: NDArray[np.uint8], edge: float) -> OverheadMap:
    # room for a border of one cell, also around a point on the edge between two
    half = math.floor(np.abs(placed[:, :2]).max(initial=0.0) / edge) + 2
    cells = np.zeros((2 * half, 2 * half), np.uint64)
    columns = np.floor(placed[:, :2] / edge).astype(np.int64) + half
    kinds, sectors = kinds_of(labels, placed[:, 2], edge), sectors_of(facing)
    bits = map_bits(kinds, sectors)
    for aside in (1, -1):
        # a normal is good to some ten degrees, so the next sectors count too
        bits |= map_bits(kinds, np.where(sectors < SECTORS, (sectors + aside) % SECTORS, sectors))
    _mark(columns, bits, cells)
    return OverheadMap(cells, edge, -half * edge)


def kinds_of(labels: NDArray[np.uint8], heights: NDArray[np.float64], edge: float
             ) -> NDArray[np.int64]:
    """Return class and band of height, two edges of a cell high, as one number, (V,)."""
    return (3 * labels.astype(np.int64) + np.floor(heights / (2 * edge)).astype(np.int64)) % KINDS


def sectors_of(facing: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the sector of the ground plane that (V, 3) normals face; SECTORS for up or down."""
    around = np.arctan2(facing[:, 1], facing[:, 0]) / (2 * np.pi) * SECTORS
    sectors = np.floor(around).astype(np.int64) % SECTORS
    return np.where(np.abs(facing[:, 2]) > FACES_UP, SECTORS, sectors)


def map_bits(kinds: NDArray[np.int64], sectors: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Return the bit of the overhead map, (V,)."""
    return np.uint64(1) << (KINDS * sectors + kinds).astype(np.uint64)


@numba.njit(cache=True, nogil=True)
def _mark(columns, bits, cells):
    for i in range(len(bits)):
        for x in range(columns[i, 0] - 1, columns[i, 0] + 2):
            for y in range(columns[i, 1] - 1, columns[i, 1] + 2):
                cells[x, y] |= bits[i]


@numba.njit(cache=True, nogil=True, inline='always')
def direction(x, y, z):
    """Return the cell of the range image that a point is seen in."""
    azimuth = int((atan2(y, x) / (2 * math.pi) + 0.5) * AZIMUTHS)
    elevation = int((atan2(z, math.sqrt(x * x + y * y)) / math.pi + 0.5) * ELEVATIONS)
    return min(max(azimuth, 0), AZIMUTHS - 1), min(max(elevation, 0), ELEVATIONS - 1)


def range_image(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the shortest range measured in each direction or next to it, metres.

    Of all (N, 3) points of a scan, in the sensor frame: it has looked through all before them.
    """
    return _shortest_around(_range_image(points))


@numba.njit(cache=True, nogil=True)
def _range_image(points):
    nearest = np.full((AZIMUTHS, ELEVATIONS), np.inf, np.float32)
    for i in range(len(points)):
        x, y, z = points[i]
        r = math.sqrt(x * x + y * y + z * z)
        if r > 0:
            a, e = direction(x, y, z)
            nearest[a, e] = min(nearest[a, e], r)
    return nearest


def _shortest_around(nearest: NDArray[np.float32]) -> NDArray[np.float32]:
    """Take the shortest of the cell and its 8 neighbours where something was measured.

    At the edge of a thing the sensor has looked past it, not through it.
    """
    around = np.minimum(nearest, np.minimum(np.roll(nearest, 1, axis=0),
                                            np.roll(nearest, -1, axis=0)))
    shortest = around.copy()
    np.minimum(shortest[:, 1:], around[:, :-1], out=shortest[:, 1:])
    np.minimum(shortest[:, :-1], around[:, 1:], out=shortest[:, :-1])
    shortest[nearest == np.inf] = np.inf
    return shortest
