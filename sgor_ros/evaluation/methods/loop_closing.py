"""Others that close loops, scan by scan: map-closures and KISS-SLAM, in their default settings.

Both compare local maps. A new one: a class that takes scans like these, and a line in
`loop_closers`.
"""
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
import sys
from typing import Any
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from . import installed

Array = NDArray[np.float64]
Points = NDArray[np.float32]

LOCAL_MAPS_M = (100.0, 20.0)
"""Lengths of local maps: the default of both, and one for drives that are shorter than that."""
NO_STAMPS = np.empty(0)
"""These scans have none a point, so there is nothing to deskew."""


@dataclass(frozen=True, eq=False)
class Closure:
    """A loop between two local maps.

    Attributes
    ----------
    source, target : int
        Numbers of the scans that are the origins of the later and of the earlier local map.
    T_target_source : (4, 4) float64
        Metres.
    scans : range
        Those of the later local map.
    """

    source: int
    target: int
    T_target_source: Array
    scans: range


class LoopCloser(Protocol):
    """Takes the points of scan after scan, (N, 3), and gives the loops that each closed."""

    def __call__(self, points: Points) -> list[Closure]:
        """Take the next scan."""

    def finish(self) -> list[Closure]:
        """Close the last local map."""


def loop_closers(say: Callable[[str], None]) -> dict[str, Callable[[], LoopCloser]]:
    """Return what makes each of those that are installed, by name."""
    makers: dict[str, Callable[[], LoopCloser]] = {}
    # with KISS-SLAM both its packages come along
    for package, name, kind in (('map_closures', 'map-closures', MapClosuresLoops),
                                ('kiss_slam', 'KISS-SLAM', KissSlamLoops)):
        if installed(package, say):
            makers |= {f'{name}, local maps of {length:g} m': partial(kind, length)
                       for length in LOCAL_MAPS_M}
    return makers


class MapClosuresLoops:
    """map-closures on local maps along KISS-ICP, as `map_closure_pipeline` builds them.

    Parameters
    ----------
    length : float
        After which a local map ends, metres.
    """

    def __init__(self, length: float) -> None:
        from kiss_icp.config import KISSConfig
        from kiss_icp.kiss_icp import KissICP
        from map_closures.config import MapClosuresConfig
        from map_closures.map_closures import MapClosures
        from map_closures.voxel_map import VoxelMap
        kiss_icp = KISSConfig()
        kiss_icp.mapping.voxel_size = 1.0
        self._odometry: Any = KissICP(kiss_icp)
        config = MapClosuresConfig()
        self._threshold = config.inliers_threshold
        self._closures: Any = MapClosures(config)
        self._map: Any = VoxelMap(voxel_size=config.density_map_resolution,
                                  max_distance=kiss_icp.data.max_range)
        self._length = length
        self._T_odom_map = np.eye(4)
        self._starts = [0]
        self._count = 0

    def __call__(self, points: Points) -> list[Closure]:
        """Take the next scan."""
        deskewed, _ = self._odometry.register_frame(points.astype(np.float64), NO_STAMPS)
        self._count += 1
        T_map_scan = se3.inverse(self._T_odom_map) @ self._odometry.last_pose
        self._map.integrate_frame(deskewed, T_map_scan)
        if np.linalg.norm(T_map_scan[:3, 3]) <= self._length:
            return []
        found = self._ended()
        self._map.remove_far_away_points(T_map_scan[:3, 3])
        kept = self._map.point_cloud()
        self._map.clear()
        self._map.integrate_frame(kept, se3.inverse(T_map_scan))
        self._T_odom_map = np.array(self._odometry.last_pose)
        self._starts.append(self._count - 1)
        return found

    def finish(self) -> list[Closure]:
        """Close the last local map."""
        return self._ended()

    def _ended(self) -> list[Closure]:
        """Return the loops of the local map that has just ended."""
        start = self._starts[-1]
        return [Closure(start, self._starts[one.source_id], se3.inverse(np.array(one.pose)),
                        range(start, self._count))
                for one in self._closures.get_closures(len(self._starts) - 1,
                                                       self._map.point_cloud())
                if one.number_of_inliers > self._threshold]


class KissSlamLoops:
    """KISS-SLAM.

    Parameters
    ----------
    length : float
        After which a local map ends, metres.
    """

    def __init__(self, length: float) -> None:
        from kiss_slam.config import load_config
        from kiss_slam.slam import KissSLAM
        config = load_config(None)
        config.local_mapper.splitting_distance = length
        self._slam: Any = KissSLAM(config)
        self._slam.closer = self._verdicts = _Verdicts(self._slam.closer)
        self._starts = [0]
        self._count = 0

    def __call__(self, points: Points) -> list[Closure]:
        """Take the next scan."""
        self._count += 1
        with redirect_stdout(sys.stderr):    # where it tells of its loops
            self._slam.process_scan(points.astype(np.float64), NO_STAMPS)
        return list(self._new())

    def finish(self) -> list[Closure]:
        """Close the last local map."""
        with redirect_stdout(sys.stderr):
            self._slam.generate_new_node()
        return list(self._new())

    def _new(self) -> Iterator[Closure]:
        """Return the loops of the local map that has just ended, if one has."""
        maps = self._slam.local_map_graph.last_id
        if maps < len(self._starts):
            return
        # a local map begins where the one before ends
        scans = range(self._starts[-1], self._count)
        self._starts.append(self._count - 1)
        for earlier, later, T_later_earlier in self._verdicts.taken():
            yield Closure(self._starts[later], self._starts[earlier],
                          se3.inverse(T_later_earlier), scans)


class _Verdicts:
    """Stands before the loop closer of KISS-SLAM, which keeps no poses of its loops."""

    def __init__(self, closer: Any) -> None:
        self._closer = closer
        self._good: list[tuple[int, int, Array]] = []

    def compute(self, *arguments: Any) -> Any:
        verdict = self._closer.compute(*arguments)
        good, earlier, later, T_later_earlier = verdict
        if good:
            self._good.append((earlier, later, np.array(T_later_earlier)))
        return verdict

    def taken(self) -> list[tuple[int, int, Array]]:
        good, self._good = self._good, []
        return good
