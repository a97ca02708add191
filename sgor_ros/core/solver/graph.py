"""Geometric consistency of all pairs of correspondences as a sparse graph (Sec. III-C).

Only 1 to 3 % of the pairs are consistent, so nothing here is N x N but one bit a pair.

Indices are unsigned: numba lets signed ones count from the end, which costs as much as the rest
of these loops.
"""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.threads import shared
from ..config import SgorConfig
from ..matching.correspondences import Correspondences
from ..scan.voxels import thin

PREFILTER_SLACK = 1e-3
"""Metres: float32 finds the candidate pairs, float64 decides. In a scan of 100 m the former errs
by some 1e-5."""
WEIGHT_STEPS = 8192
"""Steps of the table of W_m; between them it is linear, which is off by 1e-7 or so at the most."""
MOST_EDGES = 2**25
"""A quarter of a gigabyte; with more, and most matches right, some of them do."""

U64 = np.uint64
_ONE = U64(1)
# the lowest bit of a word, times this, has the place of that bit in its upper six bits
_DE_BRUIJN = U64(0x03F79D71B4CB0A89)
_PLACES = np.empty(64, np.uint32)
_PLACES[[(int(_DE_BRUIJN) << place & 2**64 - 1) >> 58 for place in range(64)]] = range(64)


@dataclass(frozen=True, eq=False)
class ConsistencyGraph:
    """Pairs of correspondences with d_ij up to `weight_cutoff` sigma_d, as compressed rows.

    Row i is ``index[start[i]:start[i + 1]]``; its first part, up to ``inner[i]``, holds the
    consistent ones (d_ij <= sigma_d: M'_g, Eq. 6), i itself among them.

    Attributes
    ----------
    start : (N + 1,) uint64
    inner : (N,) uint64
    index : (E,) uint32
    weight : (E,) float32
        W_m of each pair (Eq. 8).
    """

    start: NDArray[np.uint64]
    inner: NDArray[np.uint64]
    index: NDArray[np.uint32]
    weight: NDArray[np.float32]


def consistency_graph(correspondences: Correspondences, config: SgorConfig) -> ConsistencyGraph:
    """Compare all pairs of correspondences by length (Eq. 5, 6 and 8).

    Where more than `MOST_EDGES` are near, only some of the correspondences, evenly spread, have
    edges.
    """
    p, q = correspondences.source, correspondences.target
    n = len(p)
    reach = config.sigma_d * config.weight_cutoff
    columns = np.ascontiguousarray(np.hstack((p - p.mean(axis=0), q - q.mean(axis=0))).T,
                                   np.float32)
    bits = np.empty((n, -(-n // 64)), np.uint64)
    shared(_mark_pairs, (n + 1) // 2, columns, np.float32((reach + PREFILTER_SLACK)**2), bits)
    shared(_mirror, bits.shape[1], bits)
    start = np.zeros(n + 1, np.uint64)
    nodes = n
    while True:
        shared(_count_bits, n, bits, start[1:])
        np.cumsum(start, out=start)
        if start[-1] <= MOST_EDGES:
            break
        # pairs go with the square of the nodes
        nodes = min(int(nodes * math.sqrt(MOST_EDGES / int(start[-1]))), nodes - 1)
        _leave(bits, thin(n, nodes))
    inner = np.empty(n, np.uint64)
    # one piece of memory: of two, the system takes back what the next call asks for again
    edges = np.empty((2, start[-1]), np.uint32)
    index, weight = edges[0], edges[1].view(np.float32)
    table = np.exp(-0.5 * (np.linspace(0, reach, WEIGHT_STEPS + 1) / config.sigma_d)**2)
    shared(_weigh_pairs, n, np.hstack((p, q)), bits, config.sigma_d, reach, table, start, inner,
           index, weight)
    return ConsistencyGraph(start, inner, index, weight)


def _leave(bits: NDArray[np.uint64], rows: NDArray[np.intp]) -> None:
    """Clear all bits but those of the given rows and columns."""
    n, words = bits.shape
    kept = np.zeros(64 * words, np.bool_)
    kept[rows] = True
    bits[~kept[:n]] = 0
    bits &= np.packbits(kept, bitorder='little').view('<u8')


@numba.njit(cache=True, nogil=True, fastmath=True)
def _mark_row(columns, i, first, limit, near):
    """Write whether (|p_i - p_j| - |q_i - q_j|)^2 <= limit for j from `first` on, without a root.

    Slices, and not an index that starts at `first`, let the compiler use vectors.
    """
    px, py, pz, qx, qy, qz = columns[:, i]
    ax, ay, az = columns[0, first:], columns[1, first:], columns[2, first:]
    bx, by, bz = columns[3, first:], columns[4, first:], columns[5, first:]
    for j in range(len(ax)):
        x, y, z = ax[j] - px, ay[j] - py, az[j] - pz
        p = x * x + y * y + z * z
        x, y, z = bx[j] - qx, by[j] - qy, bz[j] - qz
        q = x * x + y * y + z * z
        s = p + q
        # (a^2 - b^2)^2 = d (2 s - d) with d = (a - b)^2 grows with d up to d = s
        near[j] = np.uint8(((p - q) * (p - q) <= limit * (s + s - limit)) | (s <= limit))


@numba.njit(cache=True, nogil=True)
def _mark_pairs(begin, end, columns, limit, bits):
    """Set bit j of row i for each candidate pair, from the 64 columns on that i itself is in."""
    n = columns.shape[1]
    gather = U64(0x0102040810204080)    # eight bytes of 0 or 1 to eight bits
    for half in range(begin, end):
        # row i beside row n - 1 - i: all tasks cost the same
        for i in ((half, n - 1 - half) if half != n - 1 - half else (half, half)):
            first = i // 64
            near = np.zeros(64 * (bits.shape[1] - first), np.uint8)
            _mark_row(columns, i, 64 * first, limit, near)
            eights = near.view(np.uint64)
            for w in range(bits.shape[1] - first):
                word = U64(0)
                for b in range(8):
                    word |= ((eights[8 * w + b] * gather) >> U64(56)) << U64(8 * b)
                bits[i, first + w] = word


@numba.njit(cache=True, nogil=True)
def _mirror(first, last, bits):
    """Fill the blocks of 64 x 64 below the diagonal from those above."""
    n, words = bits.shape
    for task in range(first, last):
        half = task // 2
        row = words - 1 - half if task % 2 else half    # short and long ones for each thread
        block = np.empty(64, np.uint64)
        for column in range(row):
            for k in range(64):
                block[k] = bits[64 * column + k, row]
            _transpose(block)
            for k in range(min(64, n - 64 * row)):
                bits[64 * row + k, column] = block[k]


@numba.njit(cache=True, nogil=True)
def _transpose(block):
    """Transpose 64 x 64 bits: swap the off-diagonal quarters, then within each quarter."""
    width, mask = U64(32), U64(0x00000000FFFFFFFF)
    while width:
        k = U64(0)
        while k < U64(64):    # the rows of upper quarters
            swap = ((block[k] >> width) ^ block[k + width]) & mask
            block[k + width] ^= swap
            block[k] ^= swap << width
            k = (k + width + _ONE) & ~width
        width >>= _ONE
        mask ^= mask << width


@numba.njit(cache=True, nogil=True)
def _count_bits(first, last, bits, count):
    """Write the bits set in each row, (N,)."""
    for i in range(U64(first), U64(last)):
        total = U64(0)
        for word in bits[i]:
            # sums of 2, 4 and 8 bits side by side, then of all bytes
            word -= (word >> _ONE) & U64(0x5555555555555555)
            word = (word & U64(0x3333333333333333)) + ((word >> U64(2)) & U64(0x3333333333333333))
            word = (word + (word >> U64(4))) & U64(0x0F0F0F0F0F0F0F0F)
            total += (word * U64(0x0101010101010101)) >> U64(56)
        count[i] = total


@numba.njit(cache=True, nogil=True, error_model='numpy')
def _weigh_pairs(first, last, both, bits, sigma_d, reach, table, start,
                 inner, index, weight):
    """Write the rows of the graph: consistent pairs from the front, others from the back.

    Candidates that float64 finds beyond `reach` stay, with weight 0.
    """
    steps = len(table) - 1
    for i in range(U64(first), U64(last)):
        near = np.empty(start[i + 1] - start[i], np.uint32)
        gap = np.empty(len(near))
        found = U64(0)
        for w in range(bits.shape[1]):
            word = bits[i, w]
            while word:
                low = word & (~word + _ONE)
                near[found] = U64(64) * U64(w) + _PLACES[(low * _DE_BRUIJN) >> U64(58)]
                found += _ONE
                word ^= low
        px, py, pz, qx, qy, qz = both[i]
        for k in range(len(near)):
            j = near[k]
            x, y, z = both[j, 0] - px, both[j, 1] - py, both[j, 2] - pz
            length = math.sqrt(x * x + y * y + z * z)
            x, y, z = both[j, 3] - qx, both[j, 4] - qy, both[j, 5] - qz
            gap[k] = abs(length - math.sqrt(x * x + y * y + z * z))
        front, back = start[i], start[i + 1] - _ONE
        for k in range(len(near)):
            d = gap[k]
            at = d * (steps / reach)
            cell = U64(min(at, steps - 1.0))
            value = np.float32(table[cell] + (at - cell) * (table[cell + _ONE] - table[cell]))
            # written at both ends and kept at one: no branch to mispredict
            index[front] = index[back] = near[k]
            weight[front] = weight[back] = value if d <= reach else np.float32(0.0)
            consistent = U64(d <= sigma_d)
            front += consistent
            back -= _ONE - consistent
        inner[i] = front
