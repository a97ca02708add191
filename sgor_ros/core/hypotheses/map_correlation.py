"""Where else a scan may lie: correlation of bird's-eye-view maps, for shifts and quarter turns."""
import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..execution.threads import parallel_for
from ..index.birds_eye_view import kinds_of
from ..index.birds_eye_view import map_bits
from ..index.birds_eye_view import sectors_of
from ..index.scan_index import ScanIndex
from ..scan.voxels import thin

QUARTER_TURNS = np.array([[[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]] for cosine, sine in
                          ((1, 0), (0, 1), (-1, 0), (0, -1))], np.float64)
"""About the third axis: what people build repeats itself under these."""
TURNS = len(QUARTER_TURNS)
KEYPOINTS, PEAKS = 200, (12, 6, 6, 6)
"""Keypoints that are swept over the map, and poses that come of each turn: along a facade the
next window is a peak, but it is the bays that repeat."""


def correlate_maps(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64],
                   radius: float) -> NDArray[np.float64]:
    """Return where the bird's-eye-view maps agree best, moved and turned from a pose: (P, 4, 4).

    Parameters
    ----------
    radius : float
        Farthest shift of the source's sensor along either axis of the ground plane, metres.
    """
    facing = source.normals @ (target.axes @ T_target_source[:3, :3]).T
    rows = _normal_space_sample(sectors_of(facing), KEYPOINTS)
    placed = se3.transform(T_target_source, source.points[rows]) @ target.axes.T
    sensor = target.axes @ T_target_source[:3, 3]
    facing = facing[rows]
    bev = target.birds_eye_view
    kinds = kinds_of(source.labels[rows], placed[:, 2], bev.edge)
    turned, bits = np.empty((TURNS, len(rows), 2)), np.empty((TURNS, len(rows)), np.uint64)
    for turn, about in enumerate(QUARTER_TURNS):
        turned[turn] = (placed[:, :2] - sensor[:2]) @ about[:2, :2].T + sensor[:2]
        bits[turn] = map_bits(kinds, sectors_of(facing @ about.T))
    columns = np.floor((turned - bev.low) / bev.edge).astype(np.int64)
    # a keypoint marks the cells around its own: every second shift is enough
    half = int(radius / (2 * bev.edge))
    hits = np.zeros((TURNS, 2 * half + 1, 2 * half + 1), np.int32)
    # even and odd columns apart, so that every second cell is the next one in memory
    parallel_for(_sweep, TURNS * (2 * half + 1), columns, bits,
                 np.stack((bev.cells[:, ::2], bev.cells[:, 1::2])), half, hits)
    # the pose itself is no other
    hits[0, half - 1:half + 2, half - 1:half + 2] = 0
    peaks = np.array(_peaks(hits, PEAKS), np.int64).reshape(-1, 3)
    about = QUARTER_TURNS[peaks[:, 0]]
    shifts = np.zeros((len(peaks), 3))
    shifts[:, :2] = 2 * bev.edge * (peaks[:, 1:] - half)
    moves = se3.compose(target.axes.T @ about @ target.axes,
                        (sensor - about @ sensor + shifts) @ target.axes)
    return moves @ T_target_source


def _normal_space_sample(sectors: NDArray[np.int64], most: int) -> NDArray[np.intp]:
    """Return rows of at most `most` keypoints, as many of each sector that they face as can be.

    Normal-space sampling (Rusinkiewicz and Levoy 2001): along a wall only the few surfaces that
    face along it tell one place from the next.
    """
    in_sectors = np.argsort(sectors, kind='stable')
    _, counts = np.unique(sectors, return_counts=True)
    members = np.split(in_sectors, np.cumsum(counts)[:-1])
    rows, left = [np.zeros(0, np.intp)], most
    for at, one in enumerate(sorted(members, key=len)):    # what small ones leave is for others
        share = min(len(one), -(-left // (len(members) - at)))
        rows.append(one[thin(len(one), share)])
        left -= share
    return np.sort(np.concatenate(rows))


@numba.njit(cache=True, nogil=True)
def _sweep(begin, end, columns, bits, cells, half, hits):
    """Count for each turn and shift, by two cells each, the points whose bit is in their cell."""
    size, width = cells.shape[1], 2 * half + 1
    for task in range(begin, end):
        turn, i = task // width, task % width
        row = hits[turn, i]
        for k in range(columns.shape[1]):
            x = columns[turn, k, 0] + 2 * (i - half)
            if x < 0 or x >= size:
                continue
            # y // 2 and the shifts that stay on the map
            at = (columns[turn, k, 1] >> 1) - half
            first, last = max(0, -at), min(width, cells.shape[2] - at)
            if first >= last:
                continue
            run = cells[columns[turn, k, 1] & 1, x, at + first:at + last]
            bit = bits[turn, k]
            for j in range(len(run)):
                row[first + j] += np.int32((run[j] & bit) != 0)


def _peaks(hits: NDArray[np.int32], most: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Return the `most` highest (turn, i, j) of each turn, none next to a higher; spoils hits."""
    peaks = []
    for turn in range(len(hits)):
        for _ in range(most[turn]):
            i, j = divmod(int(hits[turn].argmax()), hits.shape[2])
            if hits[turn, i, j] == 0:
                break
            peaks.append((turn, i, j))
            hits[turn, max(0, i - 1):i + 2, max(0, j - 1):j + 2] = 0
    return peaks
