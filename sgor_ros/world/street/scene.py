"""A small street scene: a loop road and all that lines it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..scene import close
from ..scene import Scene
from .frontage import build_up
from .frontage import furnish
from .frontage import park_cars
from .frontage import plant
from .layout import Layout
from .layout import make_layout
from .site import Site

_SCATTERED = 250  # attempts at a plant in yards and on spare land


@dataclass(frozen=True)
class StreetScene(Scene):
    """A street with houses.

    Attributes
    ----------
    layout : Layout
        Where the streets run and how high the ground is.
    """

    layout: Layout


@lru_cache(maxsize=2)    # it takes seconds, and is asked for again with each drive through it
def street_scene(seed: int = 0) -> StreetScene:
    """Build a place: a loop road with side streets, houses and all that lines them.

    Parameters
    ----------
    seed : int
        Each seed gives another place; the same seed gives the same place.

    Returns
    -------
    StreetScene
        Its triangles by class, ready for ray casting.
    """
    rng = np.random.default_rng(seed)
    layout = make_layout(rng)
    site = Site(layout, rng)
    for street in layout.streets:
        for side in (-1, 1):
            build_up(site, street, side)
            furnish(site, street, side)
            park_cars(site, street, side)
    for spot in rng.uniform(*layout.bounds, (_SCATTERED, 2)):
        plant(site, spot)

    return StreetScene(*close(site.triangles, site.pave()), layout)
