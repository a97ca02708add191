"""Lengths of pairs of matches: which may be near alike (float32), how much they are (float64)."""
import math

import numba
import numpy as np
from numpy.typing import NDArray

PREFILTER_SLACK = 1e-3
"""Metres: float32 finds the candidate pairs, float64 decides. In a scan of 100 m the former errs
by some 1e-5."""
ROOT = 64
"""Of W_m, that a short series gives; six times squared."""

U64 = np.uint64
_ONE = U64(1)


def columns_of(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float32]:
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


@numba.njit(cache=True, nogil=True, fastmath={'contract', 'nsz'})
def mark_row(columns, from_word, px, py, pz, qx, qy, qz, limit, near, row):
    """Set bit j of a row where the lengths to j may differ by the reach, from a word on.

    `near`, a byte for each j, is written on the way: each of the two loops becomes vector code,
    which one loop would not.
    """
    ax, ay, az = columns[0], columns[1], columns[2]
    bx, by, bz = columns[3], columns[4], columns[5]
    for j in range(U64(64) * U64(from_word), U64(columns.shape[1])):
        x, y, z = ax[j] - px, ay[j] - py, az[j] - pz
        p = x * x + y * y + z * z
        x, y, z = bx[j] - qx, by[j] - qy, bz[j] - qz
        q = x * x + y * y + z * z
        gap = p - q
        near[j] = gap * gap <= limit * (p + q)
    eights = near.view(np.uint64)
    for w in range(U64(from_word), U64(len(row))):
        word = U64(0)
        for k in range(U64(8)):
            # the lowest bits of eight bytes, side by side
            eight = (eights[U64(8) * w + k] * U64(0x0102040810204080)) >> U64(56)
            word |= eight << (U64(8) * k)
        row[w] = word


@numba.njit(cache=True, nogil=True, inline='always')
def count_bits(word):
    """Return how many bits of a uint64 are set."""
    word = word - ((word >> U64(1)) & U64(0x5555555555555555))
    word = (word & U64(0x3333333333333333)) + ((word >> U64(2)) & U64(0x3333333333333333))
    word = (word + (word >> U64(4))) & U64(0x0F0F0F0F0F0F0F0F)
    return (word * U64(0x0101010101010101)) >> U64(56)


@numba.njit(cache=True, nogil=True)
def places_of_bits(row, from_word, places):
    """Write the places of all bits that are set, from a word on; return how many."""
    found = U64(0)
    for w in range(U64(from_word), U64(len(row))):
        word = row[w]
        while word:
            # below the lowest bit that is set all are, once one is taken away
            places[found] = U64(64) * w + count_bits((word & (~word + _ONE)) - _ONE)
            found += _ONE
            word &= word - _ONE
    return found


@numba.njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def weigh(both, places, count, px, py, pz, qx, qy, qz, sigma_d,
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
