"""Products of a long matrix with a small one, on the thread that asks.

BLAS would share them among threads of its own, which spin for milliseconds after each product: on
two cores that took 70 % more CPU time a scan. Its limit is one for the whole process, which is not
ours to set. Products of 6 x 6 matrices and smaller are below what it shares.
"""
import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def times_vector(rows: Array, vector: Array) -> Array:
    """Return ``rows @ vector`` of (N, 3) rows and a (3,) vector, (N,)."""
    x, y, z = vector.tolist()
    out = np.empty(len(rows))
    _times_vector(np.ascontiguousarray(rows, np.float64), x, y, z, out)
    return out


def times_transposed(rows: Array, by: Array) -> Array:
    """Return ``rows @ by.T`` of (N, 3) rows and a (K, 3) matrix, (N, K)."""
    out = np.empty((len(rows), len(by)))
    _times(np.ascontiguousarray(rows, np.float64), np.ascontiguousarray(by.T, np.float64), out)
    return out


def scatter(rows: Array) -> Array:
    """Return ``rows.T @ rows`` of (N, D) rows, (D, D)."""
    size = rows.shape[1]
    out = np.empty((size, size))
    _scatter(np.ascontiguousarray(rows.T), out)
    return out


@numba.njit(cache=True, nogil=True, fastmath={'contract', 'nsz'})
def _times_vector(rows, x, y, z, out):
    for i in range(len(rows)):
        out[i] = rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * z


@numba.njit(cache=True, nogil=True, fastmath={'contract', 'nsz'})
def _times(rows, by, out):
    for i in range(len(rows)):
        x, y, z = rows[i, 0], rows[i, 1], rows[i, 2]
        for k in range(by.shape[1]):
            out[i, k] = x * by[0, k] + y * by[1, k] + z * by[2, k]


@numba.njit(cache=True, nogil=True, fastmath={'contract', 'nsz', 'reassoc'})
def _scatter(columns, out):
    for i in range(len(columns)):
        for j in range(i + 1):
            total = 0.0
            for n in range(columns.shape[1]):
                total += columns[i, n] * columns[j, n]
            out[i, j] = out[j, i] = total
