"""Indoors: a corridor and a parking garage."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..labels import BUILDING
from ..labels import OTHER_GROUND
from ..labels import OTHER_STRUCTURE
from ..labels import PARKING
from ..objects import car
from ..shapes import box
from ..shapes import place
from .place import finish
from .place import Place
from .place import straight
from .plot import Plot
from .walls import extrude
from .walls import facing_left
from .walls import facing_right
from .walls import niches

Array = npt.NDArray[np.float64]

_HALF = 165.0  # m, half a corridor; the sensor stays within 50 m of the middle
_CORRIDORS = ((1.1, 2.5, 3.0, 0.15, 0.9), (1.3, 2.8, 3.2, 0.25, 1.0), (1.1, 2.5, 2.8, 0.08, 0.9))
"""Half width, height; pitch, depth and width of the doors, m: standards, as in buildings."""
_STALL = 2.5  # m
_AISLE, _DEEP = 6.2, 5.0  # m


def corridor(rng: np.random.Generator) -> Place:
    """Build a corridor with a door every 3 m or so on either side, all alike."""
    half, top, pitch, depth, width = _CORRIDORS[int(rng.integers(len(_CORRIDORS)))]
    plot = Plot(rng, straight(100.0))
    plot.floor(OTHER_GROUND, (-_HALF, _HALF, -half - depth, half + depth))
    plot.add(OTHER_STRUCTURE, extrude([(-half, top), (half, top)], -_HALF, _HALF))
    for turn, y in ((facing_left, -half), (facing_right, half)):
        begins = np.arange(-_HALF + pitch * rng.choice([0.5, 1.0]), _HALF - pitch, pitch)
        plot.add(BUILDING, turn(niches(begins, begins + width, 0.0, 2.05,
                                       np.full(len(begins), depth), (-_HALF, _HALF), top), y))
    return finish(plot, (-40.0, 40.0, 0.35 - half, half - 0.35), sensor_height=1.0,
                  clearance=0.3, repeats=(pitch, np.inf))


def garage(rng: np.random.Generator, full: float = 0.0) -> Place:
    """Build a storey of a parking garage, a share of its stalls full of cars."""
    modules, module = int(rng.integers(3, 5)), _AISLE + 2 * _DEEP
    bay = float(rng.choice([2, 3])) * _STALL + 0.3
    fields = round(rng.uniform(130.0, 165.0) / bay)
    half, wide = fields * bay / 2, modules * module / 2
    top = float(rng.choice([2.4, 2.8]))
    aisles = (np.arange(modules) + 0.5) * module - wide
    plot = Plot(rng, straight(2 * half - 6.0, aisles[modules // 2]))
    plot.floor(PARKING, (-half, half, -wide, wide))
    plot.add(OTHER_STRUCTURE, extrude([(-wide, top), (wide, top)], -half, half))
    for y in (-wide, wide):
        plot.add(BUILDING, extrude([(y, 0.0), (y, top)], -half, half))
    for x in (-half, half):
        wall = extrude([(x, 0.0), (x, top)], -wide, wide)
        plot.add(BUILDING, place(wall, (0.0, 0.0, 0.0), np.pi / 2))
    pillar = [(OTHER_STRUCTURE, box((-0.2, 0.2), (-0.3, 0.3), (0.0, top)))]
    lines = np.arange(fields + 1) * bay - half
    for aisle in aisles:
        for side in (-1, 1):
            for x in lines[1:-1]:
                plot.put(pillar, (x, aisle + side * (_AISLE / 2 + 0.6)))
            for x in (lines[:-1, None] + 0.15 + (np.arange(round(bay // _STALL)) + 0.5)
                      * _STALL).ravel():
                if rng.random() < full:
                    spot = (x + rng.normal(0.0, 0.08),
                            aisle + side * (_AISLE / 2 + 2.55 + rng.uniform(-0.2, 0.25)))
                    plot.put(car(rng), spot, rng.choice([-1, 1]) * np.pi / 2
                             + rng.normal(0.0, 0.03))
    reach = min(half - 2.0, 45.0)
    return finish(plot, (-reach, reach, 2.0 - wide, wide - 2.0),
                  repeats=(np.inf if full else bay, np.inf))
