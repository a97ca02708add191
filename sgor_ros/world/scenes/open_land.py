"""Open land: a field, an orchard and a parking lot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..labels import OTHER_OBJECT
from ..labels import PARKING
from ..labels import TERRAIN
from ..labels import TRUNK
from ..labels import VEGETATION
from ..objects import bush
from ..objects import car
from ..objects import conifer
from ..objects import lamp_post
from ..objects import Parts
from ..objects import tree
from ..shapes import blob
from ..shapes import place
from ..shapes import tube
from ..waves import draw_waves
from ..waves import wave_sum
from .place import finish
from .place import Place
from .place import straight
from .plot import Plot

Array = npt.NDArray[np.float64]

_FIELD = 130.0  # m, half its side
_STALL, _AISLE, _DEEP = 2.5, 6.2, 5.0  # m


def field(rng: np.random.Generator) -> Place:
    """Build rolling land with trees, bushes and rocks anywhere: no two spots are alike."""
    waves = np.vstack([draw_waves(rng, 4, (60.0, 160.0), 0.6), draw_waves(rng, 8, (4.0, 20.0),
                                                                         0.04)])
    slope = rng.uniform(-0.03, 0.03, 2)
    plot = Plot(rng, straight(120.0), lambda xy: xy @ slope + wave_sum(waves, xy))
    plot.floor(TERRAIN, (-_FIELD, _FIELD, -_FIELD, _FIELD), 1.5)
    pool = [make(rng) for make, count in ((tree, 20), (conifer, 8), (bush, 20), (_rock, 20))
            for _ in range(count)]
    for spot in rng.uniform(-_FIELD, _FIELD, (int(rng.integers(220, 420)), 2)):
        if plot.room(spot, 1.0, 2.5):
            plot.put(pool[int(rng.integers(len(pool)))], spot, rng.uniform(0.0, 2 * np.pi))
    return finish(plot, (-35.0, 35.0, -35.0, 35.0))


def orchard(rng: np.random.Generator, *, jittered: bool = False) -> Place:
    """Build rows of trees: one tree again and again, or each its own with gaps between."""
    row, pitch = float(rng.choice([4.0, 4.5, 5.0])), float(rng.choice([2.5, 3.0, 4.0]))
    plot = Plot(rng, straight(140.0, row / 2))
    plot.floor(TERRAIN, (-130.0, 130.0, -90.0, 90.0))
    pool = [_fruit_tree(rng) for _ in range(40 if jittered else 1)]
    for y in row * np.arange(-15, 16):
        for x in pitch * np.arange(-round(100.0 / pitch), round(100.0 / pitch) + 1):
            if not jittered:
                plot.put(pool[0], (x, y))
            elif rng.random() > 0.12:
                plot.put(pool[int(rng.integers(len(pool)))], (x, y) + rng.normal(0.0, 0.2, 2),
                         rng.uniform(0.0, 2 * np.pi))
    return finish(plot, (-30.0, 30.0, -25.0, 25.0), clearance=0.3,
                  repeats=(np.inf, np.inf) if jittered else (pitch, row))


def parking(rng: np.random.Generator, *, jittered: bool = False) -> Place:
    """Build a parking lot: one car again and again, or each its own with gaps between."""
    module = _AISLE + 2 * _DEEP
    plot = Plot(rng, straight(140.0))
    plot.floor(PARKING, (-140.0, 140.0, -110.0, 110.0))
    pool = [car(rng) for _ in range(40 if jittered else 1)]
    for middle in module * np.arange(-5, 6):
        for side in (-1, 1):
            for x in _STALL * np.arange(-54, 55):
                spot = np.array([x, middle + side * (_AISLE / 2 + _DEEP / 2)])
                if not jittered:
                    plot.put(pool[0], spot, side * np.pi / 2)
                elif rng.random() > 0.3:
                    plot.put(pool[int(rng.integers(len(pool)))],
                             spot + rng.normal(0.0, (0.1, 0.25)),
                             rng.choice([-1, 1]) * np.pi / 2 + rng.normal(0.0, 0.04))
    mast = lamp_post(rng)
    for middle in module * (np.arange(-5, 5) + 0.5):
        for x in 10 * _STALL * np.arange(-5, 5) + _STALL / 2:
            plot.put(mast, (x, middle))
    # but for a mast each ten stalls
    return finish(plot, (-35.0, 35.0, -30.0, 30.0),
                  repeats=(np.inf, np.inf) if jittered else (_STALL, module))


def _rock(rng: np.random.Generator) -> Parts:
    size = rng.uniform(0.3, 1.2, 3) * (1.0, 1.0, 0.8)
    return [(OTHER_OBJECT, place(blob(rng, size, 0.8, 0.08, 0.0), (0.0, 0.0, 0.3 * size[2])))]


def _fruit_tree(rng: np.random.Generator) -> Parts:
    """Low tree of a plantation, of few triangles since there are many of them."""
    clear, radius = rng.uniform(0.8, 1.1), rng.uniform(0.05, 0.09)
    trunk = tube((0.0, 0.0, -0.2), (*rng.uniform(-0.1, 0.1, 2), clear + 0.8),
                 (radius, 0.7 * radius), 6)
    leaves = [place(blob(rng, rng.uniform(0.5, 0.9, 3), divisions=1),
                    (*rng.uniform(-0.3, 0.3, 2), clear + z)) for z in (0.6, 1.3)]
    return [(TRUNK, trunk), (VEGETATION, np.concatenate(leaves))]
