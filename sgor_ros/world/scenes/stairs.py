"""Stairs: flights and landings between two walls."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..labels import BUILDING
from ..labels import OTHER_GROUND
from ..labels import OTHER_OBJECT
from ..labels import OTHER_STRUCTURE
from ..shapes import box
from ..shapes import place
from .place import finish
from .place import Place
from .place import straight
from .plot import Plot
from .walls import extrude

Array = npt.NDArray[np.float64]

_STEPS = ((0.17, 0.29, 12), (0.16, 0.31, 10), (0.18, 0.27, 12))
"""Rise and tread, m, and steps of a flight: standards, as in buildings."""
_END = 10.0  # m, of the level floor at either end
_CEILING = 2.9  # m above the steps


def stairs(rng: np.random.Generator) -> Place:
    """Build a long stair straight up, a sensor being carried level: landings, doors and lamps."""
    rise, tread, steps = _STEPS[int(rng.integers(len(_STEPS)))]
    half, landing = float(rng.choice([1.4, 1.8])), float(rng.choice([1.6, 2.2]))
    flights = 8
    edges, heights = _profile(rise, tread, steps, landing, flights)

    # The slope through the middles of the treads, level on landings.
    knots = np.column_stack([edges[:-1] + tread / 2, edges[1:] - tread / 2]).ravel()

    def ground(xy: Array) -> Array:
        return np.asarray(np.interp(xy[:, 0], knots, np.repeat(heights, 2)))

    plot = Plot(rng, straight(edges[-1] - edges[0] - 6.0), ground)
    plot.add(OTHER_GROUND, _across(np.repeat(edges, 2)[1:-1], np.repeat(heights, 2), half))
    plot.add(OTHER_STRUCTURE, _across(edges[[0, 1, -2, -1]],
                                      heights[[0, 0, -1, -1]] + _CEILING, half))
    low, high = -1.0, heights[-1] + _CEILING + 1.0
    for y in (-half, half):
        plot.add(BUILDING, extrude([(y, low), (y, high)], edges[0], edges[-1]))
    for x in edges[[0, -1]]:
        wall = extrude([(-x, low), (-x, high)], -half, half)
        plot.add(BUILDING, place(wall, (0.0, 0.0, 0.0), np.pi / 2))
    for k in np.flatnonzero(np.diff(edges) > 2 * tread):
        _furnish(plot, (edges[k], edges[k + 1]), heights[k], half)
    return finish(plot, (edges[0] + 1.0, edges[-1] - 1.0, 0.5 - half, half - 0.5),
                  sensor_height=1.0, clearance=0.3, follows_slope=False)


def _profile(rise: float, tread: float, steps: int, landing: float, flights: int
             ) -> tuple[Array, Array]:
    """Give ends (N + 1,) along x, 0 in the middle, and height (N,) of treads and landings, m."""
    flight = [tread] * (steps - 1)
    lengths = [_END, *([*flight, landing] * flights)[:-1], _END]
    edges: Array = np.concatenate([[0.0], np.cumsum(lengths)])
    return edges - edges[-1] / 2, np.asarray(rise * np.arange(len(lengths)), float)


def _across(x: Array, z: Array, half: float) -> Array:
    """Surface of a profile along x (P,) with heights z (P,), m, from -half to half in y."""
    return place(extrude(np.column_stack([-x, z]), -half, half), (0.0, 0.0, 0.0), np.pi / 2)


def _furnish(plot: Plot, span: tuple[float, float], floor: float, half: float) -> None:
    """Hang a lamp over a landing and set a door frame or a notice board on either wall."""
    rng = plot.rng
    middle = rng.uniform(span[0] + 0.6, span[1] - 0.6)
    plot.add(OTHER_OBJECT, box((middle - 0.3, middle + 0.3), (-0.1, 0.1),
                               (floor + 2.3, floor + 2.4)))
    for side in (-1, 1):
        x, out = rng.uniform(span[0] + 0.5, span[1] - 0.5), rng.uniform(0.06, 0.2)
        wide, low = (0.9, 0.0) if rng.random() < 0.6 else (rng.uniform(0.4, 1.0), 1.1)
        y = side * half, side * (half - out)
        plot.add(OTHER_OBJECT, box((x - wide / 2, x + wide / 2), (min(y), max(y)),
                                   (floor + low, floor + 2.05)))
