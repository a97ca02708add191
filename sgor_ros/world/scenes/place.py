"""A scene of a kind: what is there, and where a sensor can be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..scene import close
from ..scene import Scene
from ..shapes import Rectangle
from .plot import Plot

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Place(Scene):
    """A scene in which a sensor can be put and driven.

    Attributes
    ----------
    area : tuple of float
        Rectangle that a sensor can be in, (x min, x max, y min, y max), m.
    boxes : (B, 7) array
        What stands there: x, y (m), yaw (rad), and the ends in its own x and y (m).
    path : (M, 2) array
        Where a sensor drives, m.
    closed : bool
        Whether the path ends where it begins.
    ground_height : callable
        Height of the ground (N,), m, at points (N, 2), m.
    sensor_height : float
        Above the ground, m.
    clearance : float
        Least distance of a sensor to what stands there, m.
    repeats : (float, float)
        It is the same again so far on along x and along y, m: 0 anywhere, infinity nowhere.
    follows_slope : bool
        Whether a sensor pitches with the ground, as on a car, or is carried level.
    """

    area: Rectangle
    boxes: Array
    path: Array
    closed: bool
    ground_height: Callable[[Array], Array]
    sensor_height: float
    clearance: float
    repeats: tuple[float, float]
    follows_slope: bool = True

    @property
    def way(self) -> float:
        """Length of the path, m; of a round where it is closed."""
        path = np.vstack([self.path, self.path[:1]]) if self.closed else self.path
        return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def finish(plot: Plot, area: Rectangle, *, closed: bool = False, sensor_height: float = 1.7,
           clearance: float = 0.8,
           repeats: tuple[float, float] = (np.inf, np.inf),
           follows_slope: bool = True) -> Place:
    """Close a plot: nothing is built after that; the parameters are those of `Place`."""
    return Place(*close(plot.triangles, {}), area, plot.boxes, plot.path, closed, plot.height,
                 sensor_height, clearance, repeats, follows_slope)


def straight(length: float, y: float = 0.0) -> Array:
    """Path along x through the origin, (M, 2), m, a point each 0.1 m."""
    x = np.arange(-length / 2, length / 2, 0.1)
    return np.column_stack([x, np.full(len(x), y)])
