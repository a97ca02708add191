"""Pairs and drives in the places of the built-in world, most of which repeat themselves."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..evaluation.protocols.pairs import drive_of
from ..evaluation.protocols.pairs import frame_in_memory
from ..evaluation.protocols.pairs import Pair
from ..io.datasets import Drive
from ..io.datasets import DriveScan

if TYPE_CHECKING:
    from ..world import Lidar

STREET_STEP_M, LANE_M = 1.2, 2.6
"""Between two scans of a drive down a street, and between its lanes."""


def scene_kinds(names: Sequence[str]) -> dict[str, bool]:
    """Return the kinds asked for, or all, and whether their places repeat themselves.

    Raises
    ------
    InputError
        A name that is none, or no Open3D.
    """
    try:
        from ..world.scenes import KINDS
    except ImportError as error:
        raise InputError(f'the built-in world needs Open3D ({error}): '
                         'pip install open3d') from error
    for name in names:
        if name not in KINDS:
            raise InputError(f'--kinds {name}: not one of {", ".join(KINDS)}')
    return {name: not KINDS[name].unique for name in names or KINDS}


def scene_pairs(kind: str, count: int, seed: int, lidar: Lidar | None = None) -> list[Pair]:
    """Scan places of a kind.

    Parameters
    ----------
    kind : str
        Name of the kind.
    count : int
        Places; each gives a pair of its own and a pair with the next one.
    seed : int
        Chooses places, poses and noise.
    lidar : Lidar, optional
        Default: that of a car.

    Returns
    -------
    list of Pair
        First `count` pairs of the same place, then `count` of different places.
    """
    from .. import world
    from ..world import scenes
    rng = np.random.default_rng([seed, list(scenes.KINDS).index(kind)])
    lidar = lidar or world.Lidar()
    same: list[Pair] = []
    targets: list[DriveScan] = []
    for index in range(count + 1):
        place = scenes.make(kind, 1000 * seed + index)

        def scan(pose: NDArray[np.float64], role: str, place: scenes.Place = place,
                 index: int = index) -> DriveScan:
            return frame_in_memory(f'{kind}/{index:03d}/{role}', kind,
                                   *lidar.scan(place, pose, rng))

        T_world_target, T_world_source = scenes.random_pair(place, rng,
                                                            *scenes.KINDS[kind].distances)
        targets.append(scan(T_world_target, 'target'))
        if index < count:
            same.append(Pair(scan(T_world_source, 'source'), targets[-1],
                             se3.inverse(T_world_target) @ T_world_source))
    return same + [Pair(pair.source, target, None, right=False)
                   for pair, target in zip(same, targets[1:], strict=True)]


def scene_drive(kind: str, count: int, seed: int) -> Drive:
    """Drive through the place of a kind and a seed, as far apart as its scans are meant to be."""
    from ..world import simulate
    return drive_of(kind, (scan[1:] for scan in simulate(count, seed, place=kind)))


def return_drive(kind: str, way: float, seed: int, lidar: Lidar) -> Drive:
    """Scan a drive through a place and back: the street's round, or the path of another kind.

    Parameters
    ----------
    kind : str
        'street', where the way back is in the other lane, or the name of a kind.
    way : float
        Of the way there at most, metres; of the street one round.
    seed : int
        Chooses place and noise.
    lidar : Lidar
    """
    from .. import world
    from ..world import scenes
    from ..world.return_trip import there_and_back
    rng = np.random.default_rng([seed, 3])
    scene: world.Scene
    if kind == world.STREET:
        scene = street = world.street_scene(seed)
        count = int(min(way, street.layout.loop.length) / STREET_STEP_M)
        poses = there_and_back(
            world.loop_trajectory(street, count, speed=STREET_STEP_M, period=1.0), LANE_M)
    else:
        scene = place = scenes.make(kind, seed)
        step = scenes.KINDS[kind].step
        poses = there_and_back(scenes.drive(place, int(min(way, place.way) / step), step))
    return drive_of(f'{kind}/{seed}', ((*lidar.scan(scene, T, rng), T) for T in poses))
