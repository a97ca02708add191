"""Any folder with poses, keyframes at strides, and the built-in world."""
from collections.abc import Sequence

from ...core.common import se3
from ...core.config import SgorConfig
from ...io.datasets import Drive
from ..pairs import BAND_M
from ..pairs import near_pairs
from ..pairs import Pair
from .kitti import INLIER_M
from .task import EASY
from .task import HARD
from .task import MEDIUM
from .task import Protocol
from .task import Task


def posed(drives: Sequence[Drive], max_distance_m: float, listed: Sequence[Pair] = ()
          ) -> Protocol:
    """Return all pairs of scans of a drive up to a distance, and listed ones, in bands of 10 m."""
    tasks = [Task(f'{pair.source.name} {pair.target.name}', _band(pair.distance_m), pair.source,
                  pair.target, pair.T_target_source)
             for pair in [*near_pairs(drives, max_distance_m), *listed]
             if pair.T_target_source is not None]
    return Protocol('poses', tasks, (EASY, MEDIUM, HARD), INLIER_M, SgorConfig.kitti_protocol())


def strided(drives: Sequence[Drive], strides: Sequence[int]) -> Protocol:
    """Return the pairs of keyframes so many keyframes apart: nuScenes at 2 Hz."""
    tasks = []
    for drive in drives:
        assert drive.T_world_sensor is not None
        T = drive.T_world_sensor
        for stride in strides:
            tasks += [Task(f'{drive.name} {i + stride} {i}', f'stride {stride}',
                           drive.frames[i + stride], drive.frames[i],
                           se3.inverse(T[i]) @ T[i + stride])
                      for i in range(len(drive.frames) - stride)]
    return Protocol('strides', tasks, (EASY, MEDIUM, HARD), INLIER_M,
                    SgorConfig.kitti_protocol())


def _band(distance_m: float) -> str:
    low = int(distance_m // BAND_M) * int(BAND_M)
    return f'{low}-{low + int(BAND_M)} m'
