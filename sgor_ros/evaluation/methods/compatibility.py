"""Length compatibility of pairs of matches, sparse: what the relatives of SGOR share."""
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial.distance import cdist

Array = NDArray[np.float64]

ROWS = 512
"""Rows of the matrix at a time: the whole would be dense and of half a gigabyte."""


def length_differences(source: Array, target: Array, limit: float) -> csr_array:
    """Return c_ij = | |p_i - p_j| - |q_i - q_j| | where it is below `limit`.

    Returns
    -------
    (N, N) csr_array of float64
        What is stored counts, zeros too; the diagonal is among it.
    """
    n = len(source)
    starts, columns, values = [np.zeros(1, np.int64)], [], []
    for first in range(0, n, ROWS):
        rows = slice(first, first + ROWS)
        c = np.abs(cdist(source[rows], source) - cdist(target[rows], target))
        near = c < limit
        starts.append(np.count_nonzero(near, axis=1))
        columns.append(np.nonzero(near)[1])
        values.append(c[near])
    return csr_array((np.concatenate(values), np.concatenate(columns),
                      np.cumsum(np.concatenate(starts))), shape=(n, n))


def with_values(matrix: csr_array, values: Array) -> csr_array:
    """Return a matrix with other values at the same places; those that are zero go."""
    changed = csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)
    changed.eliminate_zeros()
    return changed


def without_diagonal(matrix: csr_array) -> csr_array:
    """Return a square matrix with nothing on its diagonal."""
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return with_values(matrix, np.where(rows == matrix.indices, 0, matrix.data))


def leading_eigenvector(matrix: csr_array, rounds: int) -> Array:
    """Return the leading eigenvector (N,) by power iteration from ones."""
    vector = np.ones(matrix.shape[0])
    for _ in range(rounds):
        following = matrix @ vector
        following /= np.linalg.norm(following) + 1e-6
        if np.allclose(following, vector):
            break
        vector = following
    return vector
