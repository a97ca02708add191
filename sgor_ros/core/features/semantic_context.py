"""Semantic context: which classes stand how near around a keypoint (beyond the paper).

Seen from above, each class is a map of occupied cells; blurred at three scales and read at the
keypoints it tells places apart that look alike within the reach of a local descriptor. Rotation
about the ground normal does not change it.
"""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common.products import times_transposed
from ..config import SgorConfig
from ..execution.threads import parallel_for
from ..scan.ground import Ground
from ..scan.labels import LabelConvention
from ..scan.labels import UNLABELLED
from .descriptors import unit_rows

OCTAVES = 3
"""Blurs: `context_scale` and twice and four times that."""
TRUNCATE = 2.5
"""Standard deviations after which a blur ends."""


def context_classes(convention: LabelConvention) -> list[int]:
    """Return the classes that have a map: all that match, in a fixed order."""
    skipped = convention.ground | convention.movable
    return [UNLABELLED, *sorted(set(convention.names) - skipped - {UNLABELLED})]


def semantic_context(points: NDArray[np.float64], labels: NDArray[np.uint8], ground: Ground,
                     classes: list[int], config: SgorConfig) -> NDArray[np.float32]:
    """Describe what stands around each keypoint.

    Parameters
    ----------
    points : (V, 3) float64
        Metres.
    labels : (V,) uint8
        Regional labels.
    ground : Ground
        Gives the direction to look from.
    classes : list of int
        One map each; other classes are left out.

    Returns
    -------
    (V, 3 + 3 * len(classes)) float32
        Whatever class it is, then each class; unit rows, the first three columns apart.
    """
    cell = config.context_scale / 1.5
    across = np.linalg.svd(ground.normal[None])[2][1:]    # two axes in the ground plane
    reach = math.ceil(TRUNCATE * config.context_scale * 2**(OCTAVES - 1) / cell)
    xy = np.floor(times_transposed(points, across) / cell).astype(np.int64)
    xy += reach - xy.min(axis=0, initial=0)
    shape = xy.max(axis=0, initial=0) + reach + 1
    present = [c for c in classes if (labels == c).any()]
    column = np.full(256, -1, np.int64)
    column[present] = 1 + np.arange(len(present))
    places, of_point = np.unique(xy[:, 0] * shape[1] + xy[:, 1], return_inverse=True)
    occupied = np.zeros((len(places), 1 + len(present)), np.bool_)
    occupied[:, 0] = True
    seen = column[labels] >= 0
    occupied[of_point[seen], column[labels[seen]]] = True
    context = np.zeros((len(places), 1 + len(classes), OCTAVES), np.float32)
    columns = [0, *(1 + classes.index(c) for c in present)]
    for octave in range(OCTAVES):
        sigma = config.context_scale * 2**octave / cell
        taps = np.arange(-math.ceil(TRUNCATE * sigma), math.ceil(TRUNCATE * sigma) + 1)
        kernel = np.exp(-0.5 * (taps / sigma)**2).astype(np.float32)
        kernel *= np.sqrt(sigma) / kernel.sum()    # far scales are thinner: keep their say
        rows = np.zeros((*shape, len(columns)), np.float32)
        _blur_rows(places // shape[1], places % shape[1], occupied, kernel, rows)
        blurred = np.zeros(occupied.shape, np.float32)
        parallel_for(_blur_columns, len(places), places // shape[1], places % shape[1], rows,
                     kernel, blurred)
        context[:, columns, octave] = blurred
    flat = np.sqrt(context.reshape(len(places), OCTAVES * (1 + len(classes))))
    return np.hstack((unit_rows(flat[:, :OCTAVES]), unit_rows(flat[:, OCTAVES:])))[of_point]


@numba.njit(cache=True, nogil=True, fastmath=True)
def _blur_rows(x, y, occupied, kernel, rows):
    """Blur maps of occupied places along the first axis: (nx, ny, C)."""
    half = len(kernel) // 2
    for i in range(len(x)):
        for c in range(occupied.shape[1]):
            if occupied[i, c]:
                for t in range(len(kernel)):
                    rows[x[i] + t - half, y[i], c] += kernel[t]


@numba.njit(cache=True, nogil=True, fastmath=True)
def _blur_columns(first, last, x, y, rows, kernel, out):
    """Blur maps along the second axis, where they are wanted: (P, C)."""
    half = len(kernel) // 2
    for i in range(first, last):
        for t in range(len(kernel)):
            for c in range(out.shape[1]):
                out[i, c] += kernel[t] * rows[x[i], y[i] + t - half, c]
