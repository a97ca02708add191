"""Scenes of boxes at known places, and sensors that see them without noise."""
from dataclasses import replace
from functools import cache

import numpy as np

from sgor_ros.world import Lidar
from sgor_ros.world.scene import close
from sgor_ros.world.scene import Scene
from sgor_ros.world.shapes import box

ROAD, BUILDING, FENCE, CAR, TRUCK = 40, 50, 51, 10, 18
FAR = 400.0
# 16 beams that lose nothing
CLEAN = Lidar(16, 720, 0.25, -0.25, 1000.0, 0.0, 0.0)


def clean(sensor, max_range=1000.0):
    return replace(sensor, range_noise=0.0, drop_out=0.0, min_range=0.0, max_range=max_range)


def scene(**solids):
    """Return a scene of boxes given as label=(x, y, z), the label with a letter before it."""
    return Scene(*close({int(label[1:]): [box(*ends)] for label, ends in solids.items()}, {}))


def rng(seed=0):
    return np.random.default_rng(seed)


def at(x=0.0, y=0.0, z=0.0):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def angles(points):
    """Return azimuth and elevation, deg."""
    x, y, z = points.astype(float).T
    return np.rad2deg(np.arctan2(y, x)), np.rad2deg(np.arctan2(z, np.hypot(x, y)))


@cache
def room():
    """Return the inside of a cube of 20 m."""
    return scene(b50=((-10, 10), (-10, 10), (-10, 10)))


@cache
def floor():
    """Return level ground at z = 0."""
    return scene(r40=((-FAR, FAR), (-FAR, FAR), (-1, 0)))


@cache
def walls():
    """Return two walls that face each other, at x = 10 and at x = -20."""
    return scene(b50=((10, 11), (-FAR, FAR), (-FAR, FAR)),
                 f51=((-21, -20), (-FAR, FAR), (-FAR, FAR)))
