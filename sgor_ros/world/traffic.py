"""Vehicles that move with the sensor: seen at the same place in every scan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .labels import CAR
from .labels import TRUCK
from .scene import close
from .scene import Scene
from .shapes import box
from .shapes import place

Array = npt.NDArray[np.float64]

_GAP = 0.3  # m, a box stands so high above the road
_TRUCK = (12.0, 2.5, 3.8)  # m
_CAR = (4.5, 1.8, 1.5)  # m
_CONVOY = ((12.0, 0.0), (12.0, 3.5), (12.0, -3.5), (-12.0, 0.0), (-12.0, 3.5), (-12.0, -3.5))


def vehicles(positions: Sequence[tuple[float, float]], size: tuple[float, float, float],
             label: int = CAR, sensor_height: float = 1.73) -> Scene:
    """Build boxes that move with the sensor, for `Lidar.scan(..., companions=)`.

    Parameters
    ----------
    positions : sequence of (float, float)
        Middle of each in the sensor frame, x ahead and y left, m.
    size : (float, float, float)
        Length, width and height, m.
    label : int
        Raw SemanticKITTI label.
    sensor_height : float
        Of the sensor above the road, m.

    Returns
    -------
    Scene
        In the sensor frame.
    """
    long, wide, high = size
    body = box((-long / 2, long / 2), (-wide / 2, wide / 2), (_GAP, high))
    solids = [place(body, (x, y, -sensor_height)) for x, y in positions]
    return Scene(*close({label: solids}, {}))


def truck_beside(sensor_height: float = 1.73) -> Scene:
    """Build one truck in the lane on the left; a Scene in the sensor frame."""
    return vehicles([(0.0, 3.5)], _TRUCK, TRUCK, sensor_height)


def convoy(sensor_height: float = 1.73) -> Scene:
    """Build six cars, three ahead and three behind, in three lanes; in the sensor frame."""
    return vehicles(_CONVOY, _CAR, CAR, sensor_height)
