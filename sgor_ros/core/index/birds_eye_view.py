"""The bird's-eye-view map of one scan: what stands in each cell of its ground plane."""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

SECTORS = 8
"""Directions that a surface can face in the bird's-eye-view map, beside up and down."""
KINDS = 7
"""Classes and heights that the map tells apart for each direction: 9 times 7 bits."""
FACES_UP = 0.7
"""A surface lies rather than stands from this share of its unit normal upwards."""


@dataclass(frozen=True, eq=False)
class BirdsEyeView:
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


def birds_eye_view(placed: NDArray[np.float64], facing: NDArray[np.float64],
                   labels: NDArray[np.uint8], edge: float) -> BirdsEyeView:
    """Mark what stands in each cell.

    Parameters
    ----------
    placed, facing : (V, 3) float64
        Keypoints and unit normals along the axes of the ground plane and up, metres.
    labels : (V,) uint8
        Regional labels.
    edge : float
        Edge of a cell, metres.
    """
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
    return BirdsEyeView(cells, edge, -half * edge)


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
