"""Any folder with poses, keyframes at strides, and the built-in world."""
from collections.abc import Sequence
from dataclasses import replace

from ...core.common import se3
from ...io.datasets import Drive
from .pairs import BAND_M
from .pairs import near_pairs
from .pairs import Pair
from .protocol import outdoor
from .protocol import Protocol


def posed(drives: Sequence[Drive], max_distance_m: float, listed: Sequence[Pair] = ()
          ) -> Protocol:
    """Return all pairs of scans of a drive up to a distance, and listed ones, in bands of 10 m."""
    # errors count in z too, as in the literature
    pairs = [replace(pair, group=_band(pair.distance_m), heights_known=True)
             for pair in [*near_pairs(drives, max_distance_m), *listed]
             if pair.T_target_source is not None]
    return outdoor('poses', pairs)


def strided(drives: Sequence[Drive], strides: Sequence[int]) -> Protocol:
    """Return the pairs of keyframes so many keyframes apart: nuScenes at 2 Hz."""
    pairs = []
    for drive in drives:
        assert drive.T_world_sensor is not None
        T = drive.T_world_sensor
        for stride in strides:
            pairs += [Pair(drive.scans[i + stride], drive.scans[i],
                           se3.inverse(T[i]) @ T[i + stride],
                           name=f'{drive.name} {i + stride} {i}', group=f'stride {stride}')
                      for i in range(len(drive.scans) - stride)]
    return outdoor('strides', pairs)


def _band(distance_m: float) -> str:
    low = int(distance_m // BAND_M) * int(BAND_M)
    return f'{low}-{low + int(BAND_M)} m'
