"""Along a road: a facade in bays, and a highway."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..building import house_front
from ..labels import BUILDING
from ..labels import FENCE
from ..labels import OTHER_STRUCTURE
from ..labels import POLE
from ..labels import ROAD
from ..labels import SIDEWALK
from ..labels import TERRAIN
from ..objects import bush
from ..objects import car
from ..shapes import box
from ..shapes import place
from ..shapes import tube
from ..waves import draw_waves
from ..waves import wave_sum
from .place import finish
from .place import Place
from .place import straight
from .plot import Plot
from .walls import extrude

Array = npt.NDArray[np.float64]

_CORE = 60.0  # m
_FACADE = 240.0  # m, half its length
_DESIGNS = 4
_HIGHWAY = 340.0  # m, half its length
_POST_PITCH = 50.0  # m
_RAIL_PITCH = 4.0  # m


def facade(rng: np.random.Generator, cars: str = 'none') -> Place:
    """Build a street along a facade whose bays are all alike.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of chance.
    cars : str
        'none'; 'regular': one before each bay, all alike; 'random': any, with gaps.

    Returns
    -------
    Place
        The facade looks on the road from the right.
    """
    # Blocks are built after a few designs, so that many facades are alike.
    design = np.random.default_rng(int(rng.integers(_DESIGNS)))
    bay, walk = float(design.choice([9.0, 10.0, 11.0])), float(design.choice([2.5, 3.0]))
    road = float(rng.choice([7.0, 9.0]))
    plot = Plot(rng, straight(180.0, walk + road - 2.0))
    front = house_front(design, bay, int(design.integers(3, 6)))
    for x in bay * np.arange(-round(_FACADE / bay), round(_FACADE / bay)):
        plot.add(BUILDING, place(front, (x, 0.0, 0.0)))
    far = walk + road
    plot.floor(SIDEWALK, (-_FACADE, _FACADE, -0.5, walk))
    plot.floor(ROAD, (-_FACADE, _FACADE, walk, far))
    plot.floor(TERRAIN, (-_FACADE, _FACADE, far, far + 60.0))
    if rng.random() < 0.5:
        top = rng.uniform(0.8, 1.6)
        plot.add(OTHER_STRUCTURE, extrude(
            [(far + 2.0, 0.0), (far + 2.0, top), (far + 2.3, top), (far + 2.3, 0.0)],
            -_FACADE, _FACADE))
    model, line = car(rng), walk + 1.1
    if cars == 'regular':
        for x in bay * np.arange(-round(_FACADE / bay), round(_FACADE / bay)):
            plot.put(model, (x, line))
    elif cars == 'random':
        x = -_FACADE
        while x < _FACADE:
            if rng.random() < 0.6:
                plot.put(car(rng), (x, line + rng.uniform(-0.1, 0.1)),
                         rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.03))
            x += rng.uniform(5.6, 7.2)
    return finish(plot, (-_CORE, _CORE, 2.0, far + 2.0 - 0.9),
                  repeats=(np.inf if cars == 'random' else bay, np.inf))


def highway(rng: np.random.Generator) -> Place:
    """Build a highway: guard rails, a post every 50 m, and bushes anywhere beyond."""
    half, median = ((12.0, 1.5), (13.5, 2.0))[int(rng.integers(2))]
    # Most of them run through level land.
    waves = draw_waves(rng, 8, (8.0, 60.0), float(rng.choice([0.02, 0.02, 0.15])))
    bank = rng.uniform(-0.06, 0.06, 2) * (rng.random() < 0.3)

    def height(xy: Array) -> Array:
        out = np.abs(xy[:, 1]) - half - 1.5
        slope = np.where(xy[:, 1] > 0, bank[0], bank[1])
        return np.where(out > 0, np.clip(out / 4.0, 0.0, 1.0) * wave_sum(waves, xy)
                        + slope * np.minimum(out, 40.0), 0.0)

    plot = Plot(rng, straight(400.0, -0.6 * half), height)
    plot.floor(ROAD, (-_HIGHWAY, _HIGHWAY, -half, half))
    for side in (-1, 1):
        inner, outer = side * half, side * 90.0
        plot.floor(TERRAIN, (-_HIGHWAY, _HIGHWAY, min(inner, outer), max(inner, outer)), 2.5)
    for y in (-half - 0.6, -median / 2, median / 2, half + 0.6):
        _rail(plot, y)
    post = tube((0.0, 0.0, -0.3), (0.0, 0.0, 1.05), (0.07, 0.06))
    for x in _POST_PITCH * np.arange(-round(_HIGHWAY / _POST_PITCH),
                                     round(_HIGHWAY / _POST_PITCH) + 1):
        for side in (-1, 1):
            plot.add(POLE, place(post, (x, side * (half + 1.3), 0.0)))
    pool = [bush(rng) for _ in range(30)]
    for side in (-1, 1):
        for _ in range(int(rng.integers(15, 90))):
            spot = (rng.uniform(-_HIGHWAY, _HIGHWAY),
                    side * (half + 2.5 + rng.gamma(1.5, 6.0)))
            plot.put(pool[int(rng.integers(len(pool)))], spot, rng.uniform(0.0, 2 * np.pi))
    return finish(plot, (-_CORE, _CORE, 1.0 - half, half - 1.0))


def _rail(plot: Plot, y: float) -> None:
    """Run a guard rail along y: a band on posts."""
    band = [(y, 0.45), (y + 0.05, 0.52), (y, 0.6), (y + 0.05, 0.68), (y, 0.75)]
    plot.add(FENCE, extrude(band, -_HIGHWAY, _HIGHWAY))
    for x in np.arange(-_HIGHWAY, _HIGHWAY, _RAIL_PITCH):
        plot.add(FENCE, box((x - 0.05, x + 0.05), (y - 0.1, y), (-0.1, 0.7)))
