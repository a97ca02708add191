"""Evidence of the clouds for or against a transformation (beyond the paper).

Under the right transformation the keypoints of one scan find keypoints of the other with the same
regional label beside them, and none hangs in the air that the other sensor has looked through.
Both are asked of both scans.
"""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..common.angles import atan2
from ..scan.features import Features
from ..scan.labels import UNLABELLED

AZIMUTHS, ELEVATIONS = 360, 180
"""Cells of the range image: 1 degree, wider than the gaps between beams."""
MARGIN_SHARE = 0.02
"""A point contradicts when it is nearer than all that was seen there by this share of the range
and one cell of the view: edges and grazing rays must not speak against what is right."""
DOUBT = 0.01
"""Share of keypoints that speaks against every transformation: a handful alone proves nothing."""
SAMPLE = 400
"""Keypoints asked for each hypothesis."""


@dataclass(frozen=True, eq=False)
class View:
    """What one scan can say about points of another.

    Attributes
    ----------
    points : (V, 3) float64
        Keypoints, metres.
    labels : (V,) uint8
        Their regional labels.
    cell : float
        Cell size of the point hash, metres; the farthest partner that can be found.
    slots, chain : (S,) int32, (V,) int32
        Hash of the cells: first point of a slot, next point with the same slot.
    nearest : (360, 180) float32
        Shortest range measured in each direction, metres; infinite where nothing was.
    """

    points: NDArray[np.float64]
    labels: NDArray[np.uint8]
    cell: float
    slots: NDArray[np.int32]
    chain: NDArray[np.int32]
    nearest: NDArray[np.float32]


@dataclass(frozen=True)
class Evidence:
    """Shares of the keypoints of both scans together.

    Attributes
    ----------
    agree : float
        Have a partner of the same label.
    contradict : float
        Hang where the other sensor has looked through.
    """

    agree: float
    contradict: float

    @property
    def confidence(self) -> float:
        """The part of those who speak that speak for it, 0 to 1."""
        return self.agree / (self.agree + self.contradict + DOUBT)


def view(points: NDArray[np.float32], features: Features, cell: float) -> View:
    """Prepare the evidence of one scan from its (N, 3) points and its keypoints."""
    slots, chain = _hash_points(features.points, cell)
    return View(features.points, features.regional, cell, slots, chain, _range_image(points))


def evidence(source: View, target: View, T_target_source: NDArray[np.float64],
             reach: float) -> Evidence:
    """Ask both scans about one transformation.

    Parameters
    ----------
    reach : float
        Farthest partner, metres; at most the cell size of the views.
    """
    forth = _testify(source, target, T_target_source[None], reach, None)[0]
    back = _testify(target, source, se3.inverse(T_target_source)[None], reach, None)[0]
    asked = max(len(source.points) + len(target.points), 1)
    agree, contradict = (forth * len(source.points) + back * len(target.points)) / asked
    return Evidence(float(agree), float(contradict))


def rank(source: View, target: View, T_target_source: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return agree minus contradict for each of (H, 4, 4), from a sample of the source."""
    shares = _testify(source, target, T_target_source, target.cell, SAMPLE)
    return shares[:, 0] - shares[:, 1]


def _testify(source: View, target: View, T: NDArray[np.float64], reach: float,
             sample: int | None) -> NDArray[np.float64]:
    rows = np.arange(len(source.points))
    if sample is not None and len(rows) > sample:
        rows = np.linspace(0, len(rows) - 1, sample).astype(np.intp)
    if not len(rows):
        return np.zeros((len(T), 2))
    shares: NDArray[np.float64] = _shares(
        source.points[rows], source.labels[rows], T, target.points, target.labels, target.cell,
        target.slots, target.chain, target.nearest, reach)
    return shares


@numba.njit(cache=True, nogil=True, inline='always')
def _slot(x, y, z, mask):  # type: ignore[no-untyped-def]
    key = x * np.int64(73856093) ^ y * np.int64(19349663) ^ z * np.int64(83492791)
    return (key ^ (key >> 15)) & mask


@numba.njit(cache=True, nogil=True)
def _hash_points(points, cell):  # type: ignore[no-untyped-def]
    size = 1024
    while size < 2 * len(points):
        size *= 2
    slots = np.full(size, -1, np.int32)
    chain = np.full(len(points), -1, np.int32)
    for i in range(len(points)):
        slot = _slot(np.int64(np.floor(points[i, 0] / cell)),
                     np.int64(np.floor(points[i, 1] / cell)),
                     np.int64(np.floor(points[i, 2] / cell)), size - 1)
        chain[i] = slots[slot]
        slots[slot] = i
    return slots, chain


@numba.njit(cache=True, nogil=True, inline='always')
def _direction(x, y, z):  # type: ignore[no-untyped-def]
    azimuth = int((atan2(y, x) / (2 * math.pi) + 0.5) * AZIMUTHS)
    elevation = int((atan2(z, math.sqrt(x * x + y * y)) / math.pi + 0.5) * ELEVATIONS)
    return min(max(azimuth, 0), AZIMUTHS - 1), min(max(elevation, 0), ELEVATIONS - 1)


@numba.njit(cache=True, nogil=True)
def _range_image(points):  # type: ignore[no-untyped-def]
    nearest = np.full((AZIMUTHS, ELEVATIONS), np.inf, np.float32)
    for i in range(len(points)):
        x, y, z = points[i]
        r = math.sqrt(x * x + y * y + z * z)
        if r > 0:
            a, e = _direction(x, y, z)
            nearest[a, e] = min(nearest[a, e], r)
    return nearest


@numba.njit(cache=True, nogil=True, parallel=True)
def _shares(points, labels, T, others, other_labels, cell, slots,  # type: ignore[no-untyped-def]
            chain, nearest, reach):
    """Return the shares that agree and that contradict, (H, 2)."""
    shares = np.zeros((len(T), 2))
    outcome = np.zeros((len(T), len(points)), np.int8)
    for task in numba.prange(len(T) * len(points)):
        h = np.int64(task) // len(points)
        i = np.int64(task) % len(points)
        x = T[h, 0, 0] * points[i, 0] + T[h, 0, 1] * points[i, 1] + T[h, 0, 2] * points[i, 2] \
            + T[h, 0, 3]
        y = T[h, 1, 0] * points[i, 0] + T[h, 1, 1] * points[i, 1] + T[h, 1, 2] * points[i, 2] \
            + T[h, 1, 3]
        z = T[h, 2, 0] * points[i, 0] + T[h, 2, 1] * points[i, 1] + T[h, 2, 2] * points[i, 2] \
            + T[h, 2, 3]
        near, same = _partner(x, y, z, labels[i], others, other_labels, cell, slots, chain, reach)
        if same:
            outcome[h, i] = 1
        elif not near:
            r = math.sqrt(x * x + y * y + z * z)
            if r > 0:
                a, e = _direction(np.float32(x), np.float32(y), np.float32(z))
                # nothing measured there is no evidence
                if nearest[a, e] < np.inf and r < nearest[a, e] * (1 - MARGIN_SHARE) - cell:
                    outcome[h, i] = 2
    for row in range(len(T)):
        for column in range(len(points)):
            if outcome[row, column] > 0:
                shares[row, outcome[row, column] - 1] += 1.0 / len(points)
    return shares


@numba.njit(cache=True, nogil=True)
def _partner(x, y, z, label, others, other_labels, cell, slots,  # type: ignore[no-untyped-def]
             chain, reach):
    """Return whether any point is within reach, and whether one of the same label is.

    What has no label speaks by its place alone.
    """
    near = False
    limit = reach * reach
    # the 8 cells around that a ball of up to half a cell can touch, 27 for a larger one
    low, high = (0, 1) if 2 * reach <= cell else (-1, 1)
    cx, cy, cz = x / cell, y / cell, z / cell
    if low == 0:
        cx, cy, cz = cx - 0.5, cy - 0.5, cz - 0.5
    ix, iy, iz = np.int64(np.floor(cx)), np.int64(np.floor(cy)), np.int64(np.floor(cz))
    for dx in range(low, high + 1):
        for dy in range(low, high + 1):
            for dz in range(low, high + 1):
                k = slots[_slot(ix + dx, iy + dy, iz + dz, len(slots) - 1)]
                while k >= 0:
                    a = others[k, 0] - x
                    b = others[k, 1] - y
                    c = others[k, 2] - z
                    if a * a + b * b + c * c <= limit:
                        near = True
                        if (other_labels[k] == label or label == UNLABELLED
                                or other_labels[k] == UNLABELLED):
                            return True, True
                    k = chain[k]
    return near, False
