"""Clouds as they are shown: thinned, coloured by class, and gathered to a map that stays small."""
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.scan.labels import LabelConvention
from ..core.scan.labels import UNLABELLED
from ..core.scan.scan import SemanticScan
from ..core.scan.voxels import thin

Array = NDArray[np.float64]
Keys = NDArray[np.int64]

SHOWN_POINTS = 4000
"""Of one scan."""

MAP_POINTS = 500_000
"""Of the map: the oldest part goes when there are more."""

UNIT_SHARE, VOXEL_SHARE = 1.5, 1 / 30
"""Of the median distance of the points: the unit of lengths in a view, the voxels of the map."""

BITS, HALF = 21, 1 << 20

# of the classes inside; others take turns
COLOURS = {
    0: (140, 140, 140), 1: (100, 150, 245), 2: (130, 230, 245), 3: (50, 90, 200),
    4: (80, 60, 220), 5: (90, 110, 255), 6: (255, 60, 60), 7: (255, 80, 220), 8: (190, 60, 150),
    9: (190, 90, 190), 10: (255, 160, 255), 11: (120, 60, 130), 12: (175, 60, 100),
    13: (255, 200, 60), 14: (255, 130, 70), 15: (60, 175, 60), 16: (165, 100, 40),
    17: (150, 225, 100), 18: (255, 245, 170), 19: (255, 60, 30), 20: (200, 190, 120),
    21: (110, 190, 190), 22: (255, 120, 160)}


@dataclass(frozen=True, eq=False)
class Shown:
    """A cloud as it is shown.

    Attributes
    ----------
    points : (N, 3) float64
        Metres.
    classes : (N,) uint8
        Classes inside.
    """

    points: Array
    classes: NDArray[np.uint8]

    @property
    def labelled(self) -> bool:
        """Whether any class is known."""
        return bool((self.classes != UNLABELLED).any())

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> 'Shown':
        return Shown(self.points[rows], self.classes[rows])

    def colours(self) -> NDArray[np.uint8]:
        """Return (N, 3) colours by class, or by height where no class is known."""
        if self.labelled:
            return palette()[self.classes]
        z = self.points[:, 2]
        low, high = np.quantile(z, (0.02, 0.98)) if len(z) else (0.0, 1.0)
        share = np.clip((z - low) / max(high - low, 1e-6), 0, 1)[:, None]
        low_colour, high_colour = np.array([60, 90, 200]), np.array([255, 220, 110])
        return np.asarray(low_colour + share * (high_colour - low_colour)).astype(np.uint8)


def palette() -> NDArray[np.uint8]:
    """Return the colour of each class, (256, 3)."""
    return np.array([COLOURS.get(i, COLOURS[1 + i % 22]) for i in range(256)], np.uint8)


def median_distance(scan: SemanticScan) -> float:
    """Return the median distance of the points from the sensor, metres; of those that are some."""
    distance = np.linalg.norm(scan.points, axis=1)
    away = distance[distance > 0]
    return float(np.median(away)) if len(away) else 1.0


def shown(scan: SemanticScan, convention: LabelConvention, voxel_m: float) -> Shown:
    """Return a scan with one point a voxel, without empty returns and what is to be dropped."""
    keep = (scan.points != 0).any(axis=1)
    if scan.labels is None:
        classes = np.full(len(scan), UNLABELLED, np.uint8)
    else:
        classes, fixed, _ = convention.decode(scan.labels)
        keep &= fixed
    points = scan.points[keep].astype(np.float64)
    first = np.unique(voxel_keys(points, voxel_m), return_index=True)[1]
    return Shown(points[first], classes[keep][first])


def few(cloud: Shown) -> Shown:
    """Return a cloud of at most `SHOWN_POINTS`."""
    return cloud[thin(len(cloud.points), SHOWN_POINTS)]


def voxel_keys(points: Array, voxel_m: float) -> Keys:
    """Return a number for the voxel of each point, (N,)."""
    cell = np.floor(points / voxel_m).astype(np.int64) + HALF
    x, y, z = (cell & ((1 << BITS) - 1)).T
    return np.asarray((x << 2 * BITS) | (y << BITS) | z)


class Map:
    """Which voxels of a track are on the map; each is shown once, and their number is bounded.

    Parameters
    ----------
    voxel_m : float
        Metres.
    most : int
        Points; beyond it the oldest parts are forgotten.
    """

    def __init__(self, voxel_m: float, most: int = MAP_POINTS) -> None:
        self._voxel_m = voxel_m
        self._most = most
        self._known: Keys = np.empty(0, np.int64)
        self._parts: deque[Keys] = deque()
        self._forgotten = 0

    def __len__(self) -> int:
        return len(self._known)

    def add(self, cloud: Shown, T_odom_sensor: Array) -> tuple[int, Shown, list[int]]:
        """Add a scan.

        Returns
        -------
        part : int
            Number of the part that it becomes.
        new : Shown
            What of it is new, in the odom frame.
        forgotten : list of int
            Parts that are no longer on the map.
        """
        points = se3.transform(T_odom_sensor, cloud.points)
        keys, first = np.unique(voxel_keys(points, self._voxel_m), return_index=True)
        fresh = ~np.isin(keys, self._known, assume_unique=True)
        keys, first = keys[fresh], first[fresh]
        self._known = np.union1d(self._known, keys)
        self._parts.append(keys)
        part = self._forgotten + len(self._parts) - 1
        forgotten = []
        while len(self._known) > self._most and len(self._parts) > 1:
            self._known = np.setdiff1d(self._known, self._parts.popleft(), assume_unique=True)
            forgotten.append(self._forgotten)
            self._forgotten += 1
        return part, Shown(points[first], cloud.classes[first]), forgotten
