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

from ..common.lanes import at_most
from ..common.lanes import count
from ..common.lanes import load
from ..common.lanes import lowest
from ..common.lanes import splat
from ..common.threads import shared
from ..config import SgorConfig
from ..matching.correspondences import Correspondences
from ..scan.voxels import thin

PREFILTER_SLACK = 1e-3
"""Metres: float32 finds the candidate pairs, float64 decides. In a scan of 100 m the former errs
by some 1e-5."""
MOST_EDGES = 2**25
"""A fifth of a gigabyte; with more, and most matches right, some of them do."""
SAMPLE = 1000
"""Correspondences that tell beforehand how many edges there will be."""
BAND_PAIRS, FEWEST_BANDS, MOST_BANDS = 2**21, 4, 64
"""Candidates of so many pairs fit into the cache of a core."""

ROOT = 64
"""Of W_m, that a short series gives; six times squared."""

U64 = np.uint64
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

    shared(fill, len(bands))
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
    columns = lanes_of(p - p.mean(axis=0), q - q.mean(axis=0))
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

    shared(find, count)
    return bands, below


def lanes_of(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return (N, 3) and (N, 3) as six rows of whole words of 64, filled up with NaN."""
    columns = np.full((6, -(-len(p) // 64) * 64), np.nan, np.float32)
    columns[:3, :len(p)], columns[3:, :len(p)] = p.T, q.T
    return columns


def prefilter_limit(reach: float) -> np.float32:
    """Return the bound of (P - Q)^2 / (P + Q), P and Q squared lengths that differ by `reach`.

    With d = (a - b)^2 is (a^2 - b^2)^2 = d (2 (a^2 + b^2) - d) < 2 d (a^2 + b^2), and hardly less
    where a pair is longer than the reach.
    """
    return np.float32(2 * (reach + PREFILTER_SLACK)**2)


@numba.njit(cache=True, nogil=True)
def mark_row(columns, from_word, px, py, pz, qx, qy, qz, limit, row):  # type: ignore[no-untyped-def]
    """Set bit j of a row where the lengths to j may differ by the reach, from a word on."""
    ax, ay, az = columns[0], columns[1], columns[2]
    bx, by, bz = columns[3], columns[4], columns[5]
    px, py, pz = splat(px), splat(py), splat(pz)
    qx, qy, qz = splat(qx), splat(qy), splat(qz)
    most = splat(limit)
    parts = row.view(np.uint16)
    for part in range(U64(4) * U64(from_word), U64(len(parts))):
        j = U64(16) * part
        x, y, z = load(ax, j) - px, load(ay, j) - py, load(az, j) - pz
        p = x * x + y * y + z * z
        x, y, z = load(bx, j) - qx, load(by, j) - qy, load(bz, j) - qz
        q = x * x + y * y + z * z
        gap = p - q
        parts[part] = at_most(gap * gap, most * (p + q))


@numba.njit(cache=True, nogil=True)
def _mark(first, columns, limit, bits):  # type: ignore[no-untyped-def]
    """Set bit j of the rows from `first` on for each candidate pair i <= j; return how many."""
    found = U64(0)
    for r in range(len(bits)):
        i = first + r
        px, py, pz, qx, qy, qz = columns[:, i]
        row = bits[r]
        w = U64(i) // U64(64)
        mark_row(columns, w, px, py, pz, qx, qy, qz, limit, row)
        row[w] &= ~U64(0) << (U64(i) % U64(64))
        for k in range(w, U64(len(row))):
            found += count(row[k])
    return found


@numba.njit(cache=True, nogil=True)
def places_of_bits(row, from_word, places):  # type: ignore[no-untyped-def]
    """Write the places of all bits that are set, from a word on; return how many."""
    found = U64(0)
    for w in range(U64(from_word), U64(len(row))):
        word = row[w]
        while word:
            places[found] = U64(64) * w + lowest(word)
            found += _ONE
            word &= word - _ONE
    return found


@numba.njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def weigh(both, places, count, px, py, pz, qx, qy, qz, sigma_d,  # type: ignore[no-untyped-def]
          reach, squared, other, weight):
    """Write d_ij^2 (Eq. 5) from one match to the first `count` of some places, and W_m (Eq. 8)."""
    for k in range(U64(count)):
        j = places[k]
        x, y, z = both[j, 0] - px, both[j, 1] - py, both[j, 2] - pz
        squared[k] = x * x + y * y + z * z
        x, y, z = both[j, 3] - qx, both[j, 4] - qy, both[j, 5] - qz
        other[k] = x * x + y * y + z * z
    # without branches and calls, for vectors
    limit, scale = reach * reach, -0.5 / (sigma_d * sigma_d * ROOT)
    for k in range(U64(count)):
        p, q = squared[k], other[k]
        # (a - b)^2 = a^2 + b^2 - 2 ab, with one root and some 1e-12 lost
        d = max(p + q - 2.0 * math.sqrt(p * q), 0.0)
        x = d * scale
        # of exp(64 x) the 64th root as a series, off by 1e-11 up to eight sigma_d
        e = 1 + x * (1 + x * (1 / 2 + x * (1 / 6 + x * (1 / 24 + x * (
            1 / 120 + x * (1 / 720 + x * (1 / 5040 + x * (1 / 40320))))))))
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        squared[k] = d
        weight[k] = np.float32(e if d <= limit else 0.0)


@numba.njit(cache=True, nogil=True)
def _keep(first, both, bits, sigma_d, reach, length, below, index,  # type: ignore[no-untyped-def]
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
def _fill(first, length, band_index, band_weight, middle, place, index,  # type: ignore[no-untyped-def]
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
