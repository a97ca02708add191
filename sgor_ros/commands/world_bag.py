"""The built-in world as a labelled bag with ground truth."""
from dataclasses import dataclass
from pathlib import Path
import shutil

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.common.settings import InputError
from ..io.bags import BagWriter
from ..io.messages import odometry_of
from ..io.messages import point_cloud2
from ..io.terminal import progress

Array = NDArray[np.float64]

STREET, SPEED_M_S = 'street', 8.0
THERE_AND_BACK = 60
# zero stands for "no stamp" in ROS
FIRST_STAMP_NS = 1_000_000_000
# of the points of every so many scans, every so many are the map
MAP_SCANS, MAP_POINTS = 4, 3


@dataclass(frozen=True, eq=False)
class WorldMap:
    """Some points of the world, for a picture.

    Attributes
    ----------
    points : (P, 3) float64
        In the world, metres.
    labels : (P,) uint32
        Raw SemanticKITTI ids.
    """

    points: Array
    labels: NDArray[np.uint32]


def write_world_bag(path: Path, scans: int, seed: int, place: str = STREET
                    ) -> tuple[dict[int, Array], WorldMap]:
    """Drive through the built-in world at 10 Hz and record it, replacing an older bag.

    The clouds are on `points`, the true poses on `ground_truth`; `place` is the street or a kind
    of `world.scenes`. On the street the second half of a longer drive is the way back.

    Returns
    -------
    truth : dict of int to (4, 4) float64
        Stamp in nanoseconds to T_world_sensor.
    world : WorldMap
    """
    try:
        from ..world import scenes
        from ..world import simulate
    except ImportError as error:
        raise InputError(f'the built-in world needs Open3D ({error}): pip install open3d'
                         ) from error
    if place != STREET and place not in scenes.KINDS:
        raise InputError(f'place {place!r}: not one of {STREET}, {", ".join(scenes.KINDS)}')
    print(f'building the world and a bag of {scans} scans: {path}', flush=True)
    shutil.rmtree(path, ignore_errors=True)
    truth: dict[int, Array] = {}
    points_seen, labels_seen = [], []
    speed = SPEED_M_S if place == STREET else None
    drive = simulate(scans, seed, speed=speed, place=place,
                     back=place == STREET and scans >= THERE_AND_BACK)
    with BagWriter(path) as bag, progress('recording', scans, 'scan') as told:
        for seconds, points, labels, pose in told.over(drive):
            stamp_ns = FIRST_STAMP_NS + round(seconds * 1e9)
            bag.write('points', point_cloud2(bag.types, points, labels, stamp_ns, 'lidar'),
                      stamp_ns)
            bag.write('ground_truth', odometry_of(bag.types, pose, stamp_ns, 'world', 'lidar'),
                      stamp_ns)
            if len(truth) % MAP_SCANS == 0:
                points_seen.append(se3.transform(pose, points[::MAP_POINTS].astype(np.float64)))
                labels_seen.append(labels[::MAP_POINTS])
            truth[stamp_ns] = pose
    return truth, WorldMap(np.concatenate(points_seen), np.concatenate(labels_seen))
