"""Places of many kinds, most of which repeat themselves: parametrised, random by seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from .courtyard import courtyard
from .indoors import corridor
from .indoors import garage
from .indoors import hall
from .open_land import field
from .open_land import orchard
from .open_land import parking
from .place import Place
from .poses import drive
from .poses import random_pair
from .poses import random_pose
from .roadside import facade
from .roadside import highway
from .stairs import stairs
from .tunnels import road_tunnel
from .tunnels import tunnel

__all__ = ['KINDS', 'Kind', 'Place', 'drive', 'make', 'random_pair', 'random_pose']


@dataclass(frozen=True)
class Kind:
    """A kind of place.

    Attributes
    ----------
    build : callable
        Makes a `Place` with a source of chance.
    unique : bool
        Whether geometry leaves one answer only, however hard it is to see.
    distances : tuple of float
        Sensible distances of two sensors that see the same there, least and greatest, m.
    step : float
        Sensible way between two scans of a drive, m.
    """

    build: Callable[[np.random.Generator], Place]
    unique: bool
    distances: tuple[float, float] = (2.0, 20.0)
    step: float = 0.8


KINDS = {
    'tunnel': Kind(tunnel, unique=False),
    'tunnel_lamps_12': Kind(partial(tunnel, lamp_pitch=12.0), unique=False),
    'tunnel_lamps_25': Kind(partial(tunnel, lamp_pitch=25.0), unique=False),
    'road_tunnel': Kind(road_tunnel, unique=True),
    'corridor': Kind(corridor, unique=False, distances=(1.0, 8.0), step=0.3),
    'facade': Kind(facade, unique=False),
    'facade_cars_regular': Kind(partial(facade, cars='regular'), unique=False),
    'facade_cars_random': Kind(partial(facade, cars='random'), unique=True),
    'garage_empty': Kind(garage, unique=False),
    'garage_half_full': Kind(partial(garage, full=0.5), unique=True),
    'orchard_regular': Kind(orchard, unique=False),
    'orchard_jittered': Kind(partial(orchard, jittered=True), unique=True),
    'highway': Kind(highway, unique=True, step=2.5),
    'field': Kind(field, unique=True),
    'parking_regular': Kind(parking, unique=False),
    'parking_jittered': Kind(partial(parking, jittered=True), unique=True),
    'courtyard': Kind(courtyard, unique=True, distances=(1.0, 12.0), step=0.3),
    'hall': Kind(hall, unique=True, distances=(1.0, 12.0), step=0.3),
    'stairs': Kind(stairs, unique=True, distances=(1.0, 8.0), step=0.3),
}
"""All kinds by name."""


def make(kind: str, seed: int = 0) -> Place:
    """Build a place.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    seed : int
        Each seed gives another place of the kind; the same seed gives the same place.

    Returns
    -------
    Place
        Ready for a `Lidar`.
    """
    return KINDS[kind].build(np.random.default_rng(seed))
