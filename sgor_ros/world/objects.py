"""Things that stand in a street, each as labelled triangles about its own origin."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .labels import CAR
from .labels import OTHER_OBJECT
from .labels import POLE
from .labels import TRAFFIC_SIGN
from .labels import TRUNK
from .labels import VEGETATION
from .shapes import blob
from .shapes import box
from .shapes import frustum
from .shapes import place
from .shapes import tube

Array = npt.NDArray[np.float64]
Parts = list[tuple[int, Array]]


def car(rng: np.random.Generator) -> Parts:
    """Parked car or van along x, wheels on z = 0."""
    van = rng.random() < 0.18
    half = rng.uniform(2.3, 2.75) if van else rng.uniform(1.85, 2.35)
    wide = rng.uniform(0.92, 1.0) if van else rng.uniform(0.82, 0.93)
    height = rng.uniform(1.9, 2.4) if van else rng.uniform(1.4, 1.65)
    waist = rng.uniform(1.0, 1.1) if van else rng.uniform(0.82, 0.95)
    # Bonnet and boot lengths make saloons, hatchbacks and vans.
    bonnet = rng.uniform(0.5, 0.8) if van else rng.uniform(1.0, 1.35)
    boot = rng.uniform(0.02, 0.08) if van else rng.choice([0.1, 0.75]) * rng.uniform(0.8, 1.2)
    screen = rng.uniform(0.4, 0.75)
    rear = 0.1 if van else rng.uniform(0.25, 0.55)
    sill = rng.uniform(0.18, 0.28)
    parts = [
        frustum((-half + 0.12, half - 0.12, -wide + 0.06, wide - 0.06),
                (-half, half, -wide, wide), sill, 0.5),
        frustum((-half, half, -wide, wide),
                (-half + 0.06, half - 0.2, -wide + 0.08, wide - 0.08), 0.5, waist),
        frustum((-half + boot, half - bonnet, -wide + 0.1, wide - 0.1),
                (-half + boot + rear, half - bonnet - screen, -wide + 0.24, wide - 0.24),
                waist, height),
    ]
    wheel = rng.uniform(0.29, 0.36)
    for x in (-half * 0.62, half * 0.64):
        for y in (-wide + 0.02, wide - 0.22):
            parts.append(tube((x, y, wheel), (x, y + 0.2, wheel), (wheel, wheel), 12))
    return [(CAR, np.concatenate(parts))]


def tree(rng: np.random.Generator) -> Parts:
    """Leaning trunk below a crown of ragged blobs."""
    clear = rng.uniform(1.4, 2.6)
    radius = rng.uniform(0.09, 0.26)
    top = np.array([*rng.uniform(-0.25, 0.25, 2), clear + 0.9])
    trunk = [tube((0.0, 0.0, -0.3), top, (radius, 0.7 * radius))]
    trunk += [tube(top - (0.0, 0.0, 0.6), top + (x, y, rng.uniform(0.4, 1.0)),
                   (0.5 * radius, 0.2 * radius), 5)
              for x, y in rng.uniform(-1.0, 1.0, (3, 2))]
    spread = rng.uniform(0.8, 1.6)
    leaves = []
    for _ in range(int(rng.integers(4, 8))):
        size = spread * rng.uniform(0.6, 1.0, 3)
        shift = spread * rng.uniform((-0.9, -0.9, 0.3), (0.9, 0.9, 2.2))
        leaves.append(place(blob(rng, size), top + shift))
    return [(TRUNK, np.concatenate(trunk)), (VEGETATION, np.concatenate(leaves))]


def conifer(rng: np.random.Generator) -> Parts:
    """Stacked, shrinking blobs on a short trunk."""
    height, base = rng.uniform(3.0, 8.0), rng.uniform(0.8, 1.6)
    low = rng.uniform(0.3, 1.0)
    leaves = [place(blob(rng, (base * (1 - k), base * (1 - k), 0.14 * height)),
                    (0.0, 0.0, low + k * height)) for k in np.linspace(0.1, 0.9, 5)]
    trunk = tube((0.0, 0.0, -0.3), (0.0, 0.0, low + 0.5 * height), (0.14, 0.06))
    return [(TRUNK, trunk), (VEGETATION, np.concatenate(leaves))]


def bush(rng: np.random.Generator) -> Parts:
    """One or a few low blobs."""
    leaves = []
    for _ in range(int(rng.integers(1, 4))):
        size = rng.uniform(0.35, 0.9, 3)
        middle = (*rng.uniform(-0.7, 0.7, 2), 0.6 * size[2])
        leaves.append(place(blob(rng, size, holes=0.1), middle))
    return [(VEGETATION, np.concatenate(leaves))]


def hedge(rng: np.random.Generator, length: float) -> Parts:
    """Clipped hedge along x."""
    count = max(1, round(length / 1.6))
    half, height = length / count / 2, rng.uniform(0.9, 1.7)
    leaves = [place(blob(rng, (1.1 * half, 0.4, 0.5 * height + 0.15), 0.45, 0.07, 0.1),
                    ((2 * k + 1 - count) * half, 0.0, 0.5 * height)) for k in range(count)]
    return [(VEGETATION, np.concatenate(leaves))]


def lamp_post(rng: np.random.Generator) -> Parts:
    """Lamp post with its arm towards +y."""
    height, reach = rng.uniform(4.5, 7.5), rng.uniform(0.8, 2.0)
    parts = [
        tube((0.0, 0.0, -0.3), (0.0, 0.0, 1.2), (0.11, 0.11)),
        tube((0.0, 0.0, 1.2), (0.0, 0.0, height), (0.08, 0.05)),
        tube((0.0, 0.0, height), (0.0, reach, height + 0.3), (0.04, 0.04), 5),
        box((-0.15, 0.15), (reach - 0.1, reach + 0.5), (height + 0.22, height + 0.36)),
    ]
    return [(POLE, np.concatenate(parts))]


def sign_post(rng: np.random.Generator) -> Parts:
    """Traffic sign facing -x."""
    low, size = rng.uniform(1.5, 2.1), rng.uniform(0.3, 0.45)
    post = tube((0.0, 0.0, -0.3), (0.0, 0.0, low + 2 * size), (0.04, 0.04), 6)
    front, back = (-0.08, 0.0, low + size), (-0.05, 0.0, low + size)
    sides = int(rng.choice([3, 4, 8, 16]))
    return [(POLE, post), (TRAFFIC_SIGN, tube(front, back, (size, size), sides))]


def bollard(rng: np.random.Generator) -> Parts:
    """Thin low post."""
    return [(POLE, tube((0.0, 0.0, -0.2), (0.0, 0.0, rng.uniform(0.9, 1.2)), (0.07, 0.06)))]


def bins(rng: np.random.Generator) -> Parts:
    """One to three wheeled bins in a row along x."""
    parts = []
    for k in range(int(rng.integers(1, 4))):
        solid = frustum((-0.22, 0.22, -0.25, 0.25), (-0.29, 0.29, -0.35, 0.35),
                        0.03, rng.uniform(0.95, 1.15))
        parts.append(place(solid, (0.75 * k, rng.uniform(-0.1, 0.1), 0.0), rng.normal(0.0, 0.2)))
    return [(OTHER_OBJECT, np.concatenate(parts))]
