"""Geometric consistency of all pairs of correspondences as a sparse graph (Sec. III-C).

Few pairs are consistent, on real matches 1 to 10 %, and nothing but these is kept. Each pair is
looked at once: float32 finds candidates above the diagonal, band by band of rows; float64 decides;
then the other half is filled from the first.

Indices are unsigned: numba lets signed ones count from the end, which costs as much as the rest
of these loops.
"""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..config import SgorConfig
from ..execution.threads import parallel_for
from ..matching.correspondences import Correspondences
from ..scan.voxels import thin
from .lengths import columns_of
from .lengths import count_bits
from .lengths import mark_row
from .lengths import places_of_bits
from .lengths import prefilter_limit
from .lengths import U64
from .lengths import weigh

MOST_EDGES = 2**25
"""A fifth of a gigabyte; with more, and most matches right, some of them do."""
SAMPLE = 1000
"""Correspondences that tell beforehand how many edges there will be."""
BAND_PAIRS, FEWEST_BANDS, MOST_BANDS = 2**21, 4, 64
"""Candidates of so many pairs fit into the cache of a core."""

_ONE = U64(1)


@dataclass(frozen=True, eq=False)
class Rows:
    """Pairs of correspondences as compressed rows of a symmetric matrix.

    Row i is ``index[start[i]:start[i + 1]]``, i itself in it.

    Attributes
    ----------
    start : (N + 1,) uint64
    index : (E,) uint16, or uint32 from 65,537 correspondences on
    weight : (E,) float32
        W_m of each pair (Eq. 8).
    """

    start: NDArray[np.uint64]
    index: NDArray[np.uint16] | NDArray[np.uint32]
    weight: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ConsistencyGraph(Rows):
    """Pairs of correspondences with d_ij <= sigma_d (M', Eq. 6).

    Attributes
    ----------
    sigma_d : float
        Metres.
    reach : float
        d_ij up to which W_m is not zero, metres; beyond sigma_d it is not kept here.
    """

    sigma_d: float
    reach: float


@dataclass(frozen=True, eq=False)
class _Band:
    """The pairs i <= j of the rows from `first` on, `length` of each, in order."""

    first: int
    length: NDArray[np.uint64]
    index: NDArray[np.uint16] | NDArray[np.uint32]
    weight: NDArray[np.float32]


def consistency_graph(correspondences: Correspondences, config: SgorConfig) -> ConsistencyGraph:
    """Compare all pairs of correspondences by length (Eq. 5, 6 and 8).

    Where more than `MOST_EDGES` are consistent, only some of the correspondences, evenly spread,
    have edges.
    """
    sigma_d = config.sigma_d
    rows = pairs_within(correspondences, sigma_d, sigma_d)
    return ConsistencyGraph(rows.start, rows.index, rows.weight, sigma_d,
                            sigma_d * config.weight_cutoff)


def pairs_within(correspondences: Correspondences, sigma_d: float, reach: float) -> Rows:
    """Return the rows of all pairs with d_ij up to `reach`, and their W_m."""
    p, q = correspondences.source, correspondences.target
    n = nodes = len(p)
    if n > SAMPLE:
        some = thin(n, SAMPLE)
        share = _edges(*_upper(p[some], q[some], SAMPLE, sigma_d, reach)) / SAMPLE**2
        nodes = _affordable(n, share * n**2)
    while True:
        bands, below = _upper(p, q, nodes, sigma_d, reach)
        edges = _edges(bands, below)
        if edges <= MOST_EDGES:
            break
        nodes = min(_affordable(nodes, edges), nodes - 1)
    # of each row first those before it, then itself and those after
    before = below.sum(axis=0, dtype=np.uint64)
    start = np.zeros(n + 1, np.uint64)
    np.cumsum(before + np.concatenate([band.length for band in bands]), out=start[1:])
    middle = start[:-1] + before
    place = np.cumsum(below, axis=0, dtype=np.uint64) - below + start[:-1]
    index = np.empty(edges, bands[0].index.dtype)
    weight = np.empty(edges, np.float32)

    def fill(first: int, last: int) -> None:
        for band, own in zip(bands[first:last], place[first:last], strict=True):
            _fill(band.first, band.length, band.index, band.weight, middle, own, index, weight)

    parallel_for(fill, len(bands))
    return Rows(start, index, weight)


def _affordable(nodes: int, edges: float) -> int:
    """Return how many of the nodes have no more than `MOST_EDGES`: pairs go with their square."""
    return int(nodes * math.sqrt(MOST_EDGES / max(edges, MOST_EDGES)))


def _edges(bands: list[_Band], below: NDArray[np.uint32]) -> int:
    return sum(len(band.index) for band in bands) + int(below.sum(dtype=np.uint64))


def _upper(p: NDArray[np.float64], q: NDArray[np.float64], nodes: int, sigma_d: float,
           reach: float) -> tuple[list[_Band], NDArray[np.uint32]]:
    """Find the pairs i <= j up to a reach among some of (N, 3) matches, evenly spread.

    Returns
    -------
    list of _Band
        In order, all rows.
    (len(bands), N) uint32
        How many i < j of each j are in each band.
    """
    n = len(p)
    columns = columns_of(p - p.mean(axis=0), q - q.mean(axis=0))
    if nodes < n:
        others = np.ones(n, np.bool_)
        others[thin(n, nodes)] = False
        columns[:, :n][:, others] = np.nan
    both = np.hstack((p, q))
    limit = prefilter_limit(reach)
    count = min(max(n * n // BAND_PAIRS // 2, FEWEST_BANDS), MOST_BANDS)
    # rows get shorter, so bands get wider, to cost the same
    rows = np.rint(n - n * np.sqrt(1 - np.arange(count + 1) / count)).astype(np.int64)
    below = np.zeros((count, n), np.uint32)
    bands: list[_Band] = [None] * count    # type: ignore[list-item]

    def find(first: int, last: int) -> None:
        for b in range(first, last):
            length = np.empty(rows[b + 1] - rows[b], np.uint64)
            bits = np.empty((len(length), columns.shape[1] // 64), np.uint64)
            candidates = _mark(rows[b], columns, limit, bits)
            index = np.empty(candidates, np.uint16 if n <= 2**16 else np.uint32)
            weight = np.empty(candidates, np.float32)
            found = _keep(rows[b], both, bits, sigma_d, reach, length, below[b], index, weight)
            bands[b] = _Band(rows[b], length, index[:found], weight[:found])

    parallel_for(find, count)
    return bands, below


@numba.njit(cache=True, nogil=True)
def _mark(first, columns, limit, bits):
    """Set bit j of the rows from `first` on for each candidate pair i <= j; return how many."""
    found = U64(0)
    near = np.empty(columns.shape[1], np.uint8)
    for r in range(len(bits)):
        i = first + r
        px, py, pz, qx, qy, qz = columns[:, i]
        row = bits[r]
        w = U64(i) // U64(64)
        mark_row(columns, w, px, py, pz, qx, qy, qz, limit, near, row)
        row[w] &= ~U64(0) << (U64(i) % U64(64))
        for k in range(w, U64(len(row))):
            found += count_bits(row[k])
    return found


@numba.njit(cache=True, nogil=True)
def _keep(first, both, bits, sigma_d, reach, length, below, index,
          weight):
    """Write those of the candidates that are within reach, row after row; return how many."""
    n = len(both)
    places = np.empty(n, np.uint32)
    squared, other, near_weight = np.empty(n), np.empty(n), np.empty(n, np.float32)
    at = U64(0)
    for r in range(len(bits)):
        i = first + r
        near = places_of_bits(bits[r], i // 64, places)
        px, py, pz, qx, qy, qz = both[i]
        weigh(both, places, near, px, py, pz, qx, qy, qz, sigma_d, reach, squared, other,
              near_weight)
        begin = at
        for k in range(near):
            # written anyhow, and kept where within: no branch to mispredict
            j = places[k]
            index[at] = j
            weight[at] = near_weight[k]
            within = U64(squared[k] <= reach * reach)
            at += within
            below[j] += within
        length[r] = at - begin
        if length[r]:
            below[i] -= _ONE    # itself
    return at


@numba.njit(cache=True, nogil=True)
def _fill(first, length, band_index, band_weight, middle, place, index,
          weight):
    """Write the pairs of a band into the rows i, from their middle on, and into the rows j."""
    e = U64(0)
    for r in range(U64(len(length))):
        i = U64(first) + r
        at = middle[i]
        end = e + length[r]
        while e < end:
            j, w = band_index[e], band_weight[e]
            index[at] = j
            weight[at] = w
            at += _ONE
            if j != i:
                to = place[j]
                index[to] = i
                weight[to] = w
                place[j] = to + _ONE
            e += _ONE
