"""A map as an occupancy grid, seen from above: for planners that drive on the ground."""
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.compact_scan import CompactScan

Array = NDArray[np.float64]

OBSTACLE_M = (0.3, 2.0)
"""Heights over the ground between which a point is in the way."""
SECTORS = 720
FARTHEST_M = 30.0
"""Of a keyframe, beyond which its rays lie too far apart to say that a cell is free."""
UNKNOWN, FREE, OCCUPIED = -1, 0, 100
"""As in nav_msgs/OccupancyGrid."""


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Cells of the x-y plane of the map.

    Attributes
    ----------
    cells : (H, W) int8
        UNKNOWN, FREE or OCCUPIED; a row along x, the first at the least y.
    resolution : float
        Edge of a cell, metres.
    origin : (float, float)
        x and y of the outer corner of the first cell, metres.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float]


def occupancy_grid(scans: Iterable[tuple[Array, CompactScan]], resolution: float = 0.1
                   ) -> OccupancyGrid:
    """Return the grid of scans with their T_map_sensor, (4, 4).

    A cell is occupied where a point stands at a height that is in the way, free where a scan has
    seen the ground beyond it or in it and nothing before.

    Raises
    ------
    InputError
        No scan knows where the ground is, or a resolution that is none.
    """
    if not 0.005 <= resolution <= 10:
        raise InputError(f'resolution = {resolution}: expected 0.005 to 10 m')
    seen = [_seen(T, scan) for T, scan in scans if len(scan.arrays['plane'])]
    if not seen:
        raise InputError('map: no keyframe knows where the ground is, so that nothing is known '
                         'to be free')
    reach = FARTHEST_M + resolution
    centres = np.array([one.centre for one in seen])
    low = np.floor((centres.min(axis=0) - reach) / resolution) * resolution
    width, height = np.ceil((centres.max(axis=0) + reach - low) / resolution).astype(int).tolist()
    cells = np.full((height, width), UNKNOWN, np.int8)
    for one in seen:
        _free(cells, one, low, resolution)
    for one in seen:
        column, row = np.floor((one.obstacles - low) / resolution).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        cells[row[inside], column[inside]] = OCCUPIED
    return OccupancyGrid(cells, resolution, (float(low[0]), float(low[1])))


@dataclass(frozen=True, eq=False)
class _Seen:
    """What one scan says: its place, (O, 2) obstacles, and how far it is free around, (S,)."""

    centre: Array
    obstacles: Array
    reach: Array


def _seen(T_map_sensor: Array, scan: CompactScan) -> _Seen:
    points, plane = scan.arrays['surface_points'].astype(np.float64), scan.arrays['plane']
    height = points @ plane[:3] + plane[3]
    placed = se3.transform(T_map_sensor, points)[:, :2]
    centre = se3.transform(T_map_sensor, scan.arrays['origin'][None])[0, :2]
    ray = placed - centre
    distance = np.hypot(*ray.T)
    sector = _sector(ray)
    low, high = OBSTACLE_M
    blocks, ground = (height > low) & (height < high), height <= low
    reach = np.zeros(SECTORS)
    np.maximum.at(reach, sector[ground], distance[ground])
    nearest = np.full(SECTORS, FARTHEST_M)
    np.minimum.at(nearest, sector[blocks], distance[blocks])
    return _Seen(centre, placed[blocks], np.minimum(reach, nearest))


def _sector(ray: Array) -> NDArray[np.int64]:
    turn = np.arctan2(ray[..., 1], ray[..., 0]) / (2 * np.pi)
    return np.floor(turn * SECTORS).astype(np.int64) % SECTORS


def _free(cells: NDArray[np.int8], seen: _Seen, low: Array, resolution: float) -> None:
    """Mark what a scan has looked over."""
    first = np.floor((seen.centre - FARTHEST_M - low) / resolution).astype(int).clip(0)
    last = np.ceil((seen.centre + FARTHEST_M - low) / resolution).astype(int)
    part = cells[first[1]:last[1], first[0]:last[0]]
    rows, columns = np.indices(part.shape)
    ray = np.stack((columns + first[0] + 0.5, rows + first[1] + 0.5), axis=-1) * resolution + (
        low - seen.centre)
    part[np.hypot(ray[..., 0], ray[..., 1]) < seen.reach[_sector(ray)]] = FREE
