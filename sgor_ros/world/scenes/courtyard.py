"""A courtyard: walls on all sides, and what stands about in it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..building import house_front
from ..labels import BUILDING
from ..labels import OTHER_OBJECT
from ..labels import SIDEWALK
from ..objects import bins
from ..objects import bush
from ..objects import Parts
from ..objects import tree
from ..shapes import box
from ..shapes import place
from .place import finish
from .place import Place
from .plot import Plot

Array = npt.NDArray[np.float64]


def courtyard(rng: np.random.Generator) -> Place:
    """Build a yard of 18 x 20 m or so, with windows, doors, furniture and plants."""
    long = rng.uniform(17.0, 23.0)
    wide = long - rng.uniform(0.0, 4.0)
    plot = Plot(rng, rounded(long / 2 - 4.0, wide / 2 - 4.0))
    storeys, designs = int(rng.integers(2, 5)), rng.integers(2**32, size=4)
    own = int(rng.choice([1, 2, 4]))    # one design for all sides, for opposite ones, or none
    for side in range(4):
        length, away = (long, wide) if side % 2 == 0 else (wide, long)
        wall = house_front(np.random.default_rng(designs[side % own]), length, storeys)
        yaw = side * np.pi / 2
        plot.add(BUILDING, place(wall, np.array([np.sin(yaw), -np.cos(yaw), 0.0]) * away / 2,
                                 yaw))
    plot.floor(SIDEWALK, (-long / 2 - 1.5, long / 2 + 1.5, -wide / 2 - 1.5, wide / 2 + 1.5))
    things = (table, bench, _planter, tree, bush, bins)
    for spot in rng.uniform((1.6 - long / 2, 1.6 - wide / 2), (long / 2 - 1.6, wide / 2 - 1.6),
                            (int(rng.integers(30, 60)), 2)):
        if plot.room(spot, 0.9, 0.6):
            plot.put(things[int(rng.integers(len(things)))](rng), spot,
                     rng.uniform(0.0, 2 * np.pi))
    return finish(plot, (1.8 - long / 2, long / 2 - 1.8, 1.8 - wide / 2, wide / 2 - 1.8),
                  closed=True, sensor_height=1.0, clearance=0.5)


def rounded(a: float, b: float) -> Array:
    """Draw a rounded rectangle of half sides a and b, (M, 2), m."""
    t = np.linspace(0.0, 2 * np.pi, 600, endpoint=False)
    cos, sin = np.cos(t), np.sin(t)
    return np.column_stack([a * np.sign(cos) * np.abs(cos) ** 0.6,
                            b * np.sign(sin) * np.abs(sin) ** 0.6])


def table(rng: np.random.Generator) -> Parts:
    """Table on four legs."""
    a, b = rng.uniform(0.4, 0.9), rng.uniform(0.35, 0.5)
    legs = [box((x - 0.04, x + 0.04), (y - 0.04, y + 0.04), (0.0, 0.7))
            for x in (0.1 - a, a - 0.1) for y in (0.1 - b, b - 0.1)]
    return [(OTHER_OBJECT, np.concatenate([box((-a, a), (-b, b), (0.7, 0.75)), *legs]))]


def bench(rng: np.random.Generator) -> Parts:
    """Bench with a back."""
    a = rng.uniform(0.6, 1.0)
    return [(OTHER_OBJECT, np.concatenate([
        box((-a, a), (-0.22, 0.22), (0.4, 0.46)), box((-a, a), (-0.24, -0.19), (0.5, 0.9)),
        *(box((x - 0.05, x + 0.05), (-0.2, 0.2), (0.0, 0.4)) for x in (0.1 - a, a - 0.1))]))]


def _planter(rng: np.random.Generator) -> Parts:
    a, b, high = *rng.uniform(0.3, 0.8, 2), rng.uniform(0.4, 0.7)
    green = [(label, place(part, (0.0, 0.0, high))) for label, part in bush(rng)]
    return [(OTHER_OBJECT, box((-a, a), (-b, b), (0.0, high))), *green]
