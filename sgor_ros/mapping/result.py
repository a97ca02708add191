"""What the mapper returns: `Loop`, `MappedScan`, `Trajectory`."""
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tracker import TrackedScan

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop closure: two scans of one place, and how they lie to each other.

    Attributes
    ----------
    source_stamp_ns, target_stamp_ns : int
        Stamps of the later and of the earlier scan, nanoseconds.
    T_target_source : (4, 4) float64
        Pose of the later sensor seen from the earlier, metres.
    covariance : (6, 6) float64
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2.
    """

    source_stamp_ns: int
    target_stamp_ns: int
    T_target_source: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class MappedScan(TrackedScan):
    """What became of one scan: all that the tracker says of it, and the loops that it closed.

    Attributes
    ----------
    loops : tuple of Loop
        Closed while this scan was worked on. The source may be a scan some metres before, where
        its candidates had to wait or where one loop waited for another to agree with.
    T_map_odom : (4, 4) float64 or None
        Where the frame of the track lies in the map, by all loops so far: ``T_map_odom @
        T_odom_sensor`` is the corrected pose. It jumps where a loop is closed. None without a
        pose, and with a map that was there before as long as the sensor is not found in it.
    hypotheses : tuple of (4, 4) float64
        T_map_sensor at each place of that map that fits, as long as there are several: what is
        driven next decides. None where it is found.
    """

    loops: tuple[Loop, ...] = ()
    T_map_odom: Array | None = None
    hypotheses: tuple[Array, ...] = ()


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The optimised poses of all scans that have one; unpacks into its first two fields.

    Attributes
    ----------
    stamps_ns : (N,) int64
        In the order of tracking, nanoseconds.
    T_map_sensor : (N, 4, 4) float64
        Metres, in the frame of the first scan.
    part : (N,) int64
        Number of the part of the map that a scan belongs to. Poses of two parts have nothing to
        do with each other: no loop joins them yet.
    """

    stamps_ns: NDArray[np.int64]
    T_map_sensor: Array
    part: NDArray[np.int64]

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.stamps_ns, self.T_map_sensor))
