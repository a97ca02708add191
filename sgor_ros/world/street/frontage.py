"""What lines a street: houses, gardens, parked cars, trees, posts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .. import objects
from ..building import house
from ..labels import BUILDING
from ..shapes import place
from .layout import Street
from .site import Site

Array = npt.NDArray[np.float64]


def build_up(site: Site, street: Street, side: int) -> None:
    """Build houses and gardens along one side of a street, +1 left or -1 right."""
    rng = site.rng
    along, zone_end, zone = rng.uniform(0.0, 6.0), 0.0, 'row'
    while along < street.length - 6.0:
        if along >= zone_end:
            zone = str(rng.choice(['row', 'detached', 'park'], p=[0.3, 0.5, 0.2]))
            zone_end = along + rng.uniform(30.0, 70.0)
            setback = rng.uniform(0.2, 2.5) if zone == 'row' else rng.uniform(3.0, 7.0)
            storeys = int(rng.integers(2, 5))
        width = rng.uniform(7.0, 18.0) if zone == 'row' else rng.uniform(8.0, 13.0)
        gap = 0.0 if zone == 'row' else rng.uniform(2.5, 7.0)
        if zone == 'park':
            _green(site, street, side, along)
            along += 7.0
            continue
        floors = storeys if zone == 'row' else int(rng.integers(1, 4))
        inset = setback + rng.choice([0.0, 0.0, 0.5, 1.2])
        if _build(site, street, side, along + width / 2, width, inset, max(1, floors)):
            if inset > 1.5:
                _garden(site, street, side, along, width + gap, inset)
            along += width + gap
        else:
            along += 3.0


def _build(site: Site, street: Street, side: int, along: float, width: float,
           inset: float, storeys: int) -> bool:
    """Put up a house, if it finds room within a few metres of where it should be."""
    depth = site.rng.uniform(8.0, 12.0)
    for retreat in (0.0, 1.0, 2.0, 3.5):
        out = street.half_width + site.layout.sidewalk + inset + retreat
        front, heading = street.at(along, side * out)
        # The front looks along +y of the house, towards the street.
        yaw = heading + (np.pi if side > 0 else 0.0)
        u, v = np.meshgrid(np.arange(-width / 2 + 0.4, width / 2 - 0.2, 0.4),
                           np.arange(-depth, -0.2, 0.4))
        flat = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=-1)
        plot = place(flat, (*front, 0.0), yaw)[:, :2]
        clear = site.layout.kerb_distance(plot).min() > site.layout.sidewalk + min(inset, 1.2)
        if clear and site.claim(plot):
            shell = house(site.rng, width, depth, storeys)
            site.put([(BUILDING, shell)], front, yaw + site.rng.normal(0.0, 0.01))
            return True
    return False


def _garden(site: Site, street: Street, side: int, along: float, width: float,
            inset: float) -> None:
    """Fence or hedge to the street, a drive with or without a car, some green."""
    rng = site.rng
    edge = street.half_width + site.layout.sidewalk + 0.25
    drive = 3.2
    kind = rng.choice(['fence', 'hedge', 'open'], p=[0.45, 0.35, 0.2])
    stop = min(along + width - drive, street.length - 2.5)
    for begin in np.arange(along, stop, 2.0):
        start, _ = street.at(begin, side * edge)
        end, _ = street.at(begin + 2.0, side * edge)
        middle, heading = street.at(begin + 1.0, side * edge)
        if not _beside(site, street, middle, edge) or rng.random() < 0.06:
            continue
        if kind == 'fence':
            site.fence(start, end)
        elif kind == 'hedge':
            site.put(objects.hedge(rng, 2.0), middle, heading)
    if rng.random() < 0.5:
        spot, heading = street.at(along + width - drive / 2, side * (edge + inset + 2.0))
        ring = spot + rng.uniform(-0.4, 0.4, (6, 2))
        if site.layout.kerb_distance(spot[None])[0] > 4.5 and site.claim(ring):
            site.put(objects.car(rng), spot, heading + np.pi / 2 + rng.normal(0.0, 0.12))
    for _ in range(int(rng.integers(2, 7))):
        spot, _ = street.at(along + rng.uniform(0.0, width - drive),
                            side * (edge + rng.uniform(1.0, max(1.2, inset))))
        plant(site, spot)


def _green(site: Site, street: Street, side: int, along: float) -> None:
    """Stretch of a small park."""
    edge = street.half_width + site.layout.sidewalk
    for _ in range(6):
        spot, _ = street.at(along + site.rng.uniform(0.0, 7.0),
                            side * (edge + site.rng.uniform(1.0, 14.0)))
        plant(site, spot)


def plant(site: Site, spot: Array) -> None:
    """Put a tree, conifer or bush at a point (2,), m, if it is free terrain."""
    rng = site.rng
    room = site.layout.kerb_distance(spot[None])[0] > site.layout.sidewalk + 0.9
    corners = spot + np.array([(-0.7, -0.7), (0.7, -0.7), (0.7, 0.7), (-0.7, 0.7)])
    if room and site.claim(corners):
        kind = rng.choice([objects.tree, objects.conifer, objects.bush], p=[0.5, 0.15, 0.35])
        site.put(kind(rng), spot, rng.uniform(0.0, 2 * np.pi))


def park_cars(site: Site, street: Street, side: int) -> None:
    """Park cars at the kerb, in runs with gaps."""
    rng = site.rng
    along, dense = rng.uniform(3.0, 12.0), 0.6
    while along < street.length - 4.0:
        if rng.random() < 0.15:
            dense = float(rng.choice([0.05, 0.5, 0.9]))
        kerb, heading = street.at(along, side * street.half_width)
        if rng.random() < dense and _beside(site, street, kerb, street.half_width):
            spot, _ = street.at(along, side * (street.half_width - rng.uniform(1.1, 1.25)))
            turn = heading + (0.0 if side < 0 else np.pi) + rng.normal(0.0, 0.04)
            if site.inside(spot[None]):
                site.put(objects.car(rng), spot, turn)
        along += rng.uniform(5.6, 7.2)


def furnish(site: Site, street: Street, side: int) -> None:
    """Stand lamps, trees, signs, bollards and bins on a sidewalk."""
    rng, layout = site.rng, site.layout
    near = street.half_width + 0.45
    trees = float(rng.choice([9.0, 16.0, 40.0]))
    plan = [
        (objects.lamp_post, near, 28.0),
        (objects.sign_post, near, 35.0),
        (objects.bollard, near, 45.0),
        (objects.tree, near + 0.3, trees),
        (objects.bins, street.half_width + layout.sidewalk - 0.5, 26.0),
    ]
    for make, out, pitch in plan:
        along = rng.uniform(0.0, pitch)
        while along < street.length:
            spot, heading = street.at(along, side * out)
            # Signs face the traffic and lamps the road on their side.
            yaw = heading + (np.pi if side > 0 else 0.0) + rng.normal(0.0, 0.08)
            if _beside(site, street, spot, out) and site.claim(spot[None]):
                site.put(make(rng), spot, yaw)
            along += pitch * rng.uniform(0.6, 1.4)


def _beside(site: Site, street: Street, spot: Array, out: float) -> bool:
    """Whether a point beside a street is clear of all the other streets."""
    distance = site.layout.kerb_distance(spot[None])[0]
    return bool(abs(distance - (out - street.half_width)) < 0.15)
