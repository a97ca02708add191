"""Tunnels: bare, with lamps, and with what a road tunnel has."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..labels import OTHER_OBJECT
from ..labels import OTHER_STRUCTURE
from ..labels import ROAD
from ..labels import SIDEWALK
from ..objects import car
from ..shapes import box
from .place import finish
from .place import Place
from .place import straight
from .plot import Plot
from .walls import extrude
from .walls import facing_left
from .walls import facing_right
from .walls import niches

Array = npt.NDArray[np.float64]

_HALF = 320.0  # m; the sensor stays within 100 m of the middle, so no end is in reach
_CORE = 60.0  # m
_PATH = 180.0  # m
_SECTIONS = ((4.9, 2.2, 0.8), (5.5, 1.6, 1.0))
"""Half width, height of the upright wall, walkway, m: standards, so that many are alike."""


def tunnel(rng: np.random.Generator, lamp_pitch: float | None = None) -> Place:
    """Build a straight tunnel under a vault, with lamps at a pitch (m) along its walls or none."""
    half, wall, kerb = _SECTIONS[int(rng.integers(len(_SECTIONS)))]
    if rng.random() < 0.3:
        half += rng.normal(0.0, 0.1)
    plot = Plot(rng, straight(_PATH, -0.25 * half))
    _deck(plot, half, kerb)
    angle = np.linspace(0.0, np.pi, 25)
    vault = np.column_stack([half * np.cos(angle), wall + (6.6 - wall) * np.sin(angle)])
    plot.add(OTHER_STRUCTURE, extrude([(half, 0.0), *vault, (-half, 0.0)], -_HALF, _HALF))
    if lamp_pitch:
        sides = [(-1,), (1,), (-1, 1)][int(rng.integers(3))]
        # A narrow sensor sees no ceiling: they hang where it looks.
        size, high = _lamp(rng), rng.uniform(1.3, 2.2)
        for side in sides:
            y = side * half * np.sqrt(1 - max(0.0, (high - wall) / (6.6 - wall)) ** 2)
            _lamps(plot, lamp_pitch, y, side, size, high)
    return finish(plot, (-_CORE, _CORE, kerb - half + 0.6, half - kerb - 0.6),
                  repeats=(lamp_pitch or 0.0, np.inf))


def road_tunnel(rng: np.random.Generator) -> Place:
    """Build a tunnel of two lanes with lamps, niches on either side and standing cars."""
    half, top = float(rng.choice([4.9, 5.4])), float(rng.choice([4.8, 5.2]))
    kerb = float(rng.choice([0.8, 1.0]))
    plot = Plot(rng, straight(_PATH, -0.3 * half))
    _deck(plot, half, kerb)
    for turn, y in ((facing_left, -half), (facing_right, half)):
        begins = np.cumsum(rng.uniform(18.0, 60.0, 40)) - _HALF
        begins = begins[begins < _HALF - 5.0]
        ends = begins + rng.choice([1.4, 2.4, 4.0], len(begins))
        plot.add(OTHER_STRUCTURE, turn(niches(
            begins, ends, 0.15, float(rng.choice([2.2, 2.6])),
            np.asarray(rng.choice([0.4, 0.9, 1.6], len(begins)), float), (-_HALF, _HALF), top), y))
    plot.add(OTHER_STRUCTURE, extrude([(-half, top), (half, top)], -_HALF, _HALF))
    pitch, high = float(rng.choice([10.0, 12.5, 15.0])), rng.uniform(1.8, 2.4)
    for side in (-1, 1):
        _lamps(plot, pitch, side * half, side, _lamp(rng), high)
    x = -_HALF
    while x < _HALF:
        x += float(rng.uniform(7.0, 45.0))
        # In the other lane, or at the very edge, so that there is a way past them.
        y = float(rng.choice([0.45 * half - rng.uniform(0.2, 0.5), kerb + 1.0 - half]))
        if abs(y - plot.path[0, 1]) > 1.5:
            plot.put(car(rng), (x, y), rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.03))
    return finish(plot, (-_CORE, _CORE, kerb - half + 0.6, half - kerb - 0.6))


def _deck(plot: Plot, half: float, kerb: float) -> None:
    """Lay the road between two raised walkways."""
    inner = half - kerb
    plot.floor(ROAD, (-_HALF, _HALF, -inner, inner))
    for side in (-1, 1):
        plot.add(SIDEWALK, extrude([(side * inner, 0.0), (side * inner, 0.18),
                                    (side * half, 0.18)], -_HALF, _HALF))


def _lamp(rng: np.random.Generator) -> Array:
    """Draw length, depth and height of a lamp with its casing, m."""
    return rng.uniform((0.6, 0.2, 0.25), (1.8, 0.4, 0.6))


def _lamps(plot: Plot, pitch: float, y: float, side: int, size: Array, high: float) -> None:
    """Hang boxes of a size on a wall at y, all alike, from one end to the other."""
    long, deep, tall = size
    inner = y - side * deep
    for x in np.arange(-_HALF, _HALF, pitch):
        plot.add(OTHER_OBJECT, box((x - long / 2, x + long / 2), (min(y, inner), max(y, inner)),
                                   (high - tall / 2, high + tall / 2)))
