"""Indoors: a corridor, a parking garage and a hall."""

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
from .courtyard import bench
from .courtyard import rounded
from .courtyard import table
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


def hall(rng: np.random.Generator) -> Place:
    """Build a hall of 25 x 17 m or so: doors and pillars at its walls, tables and benches."""
    half, wide = rng.uniform(11.0, 15.0), rng.uniform(7.5, 9.5)
    top = float(rng.choice([4.5, 6.0, 7.5]))
    plot = Plot(rng, rounded(half - 3.0, wide - 3.0))
    plot.floor(OTHER_GROUND, (-half - 1.0, half + 1.0, -wide - 1.0, wide + 1.0))
    plot.add(OTHER_STRUCTURE, extrude([(-wide, top), (wide, top)], -half, half))
    for side in range(4):
        length, away = (half, wide) if side % 2 == 0 else (wide, half)
        begins = np.arange(0.8 - length, length - 3.0, 4.0) + rng.uniform(0.0, 1.5)
        depths = np.asarray(rng.choice([0.15, 0.5, 0.9], len(begins)), float)
        wall = niches(begins, begins + rng.uniform(0.9, 2.2, len(begins)), 0.0, 2.3, depths,
                      (-length, length), top)
        yaw = side * np.pi / 2
        plot.add(BUILDING, place(wall, np.array([np.sin(yaw), -np.cos(yaw), 0.0]) * away, yaw))
    pillar = [(OTHER_STRUCTURE, box((-0.25, 0.25), (-0.25, 0.25), (0.0, top)))]
    for x in np.arange(1.5 - half, half - 1.0, float(rng.choice([4.0, 5.0]))):
        for y in (0.6 - wide, wide - 0.6):
            plot.put(pillar, (x, y))
    for spot in rng.uniform((1.5 - half, 1.5 - wide), (half - 1.5, wide - 1.5),
                            (int(rng.integers(20, 40)), 2)):
        if plot.room(spot, 0.9, 0.6):
            thing = (table, bench)[int(rng.integers(2))]
            plot.put(thing(rng), spot, rng.uniform(0.0, 2 * np.pi))
    return finish(plot, (1.5 - half, half - 1.5, 1.5 - wide, wide - 1.5), closed=True,
                  sensor_height=1.0, clearance=0.5)
