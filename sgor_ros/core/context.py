"""Semantic context: which classes stand how near around a keypoint (beyond the paper).

Seen from above, each class is a map of occupied cells; blurred at three scales and read at the
keypoints it tells places apart that look alike within the reach of a local descriptor. Rotation
about the ground normal does not change it.
"""
import math

import numba
import numpy as np
from numpy.typing import NDArray

from .config import SgorConfig
from .ground import Ground
from .labels import LabelConvention
from .labels import UNLABELLED

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
    (V, 3 * len(classes)) float32
        Unit rows.
    """
    cell = config.context_scale / 1.5
    across = np.linalg.svd(ground.normal[None])[2][1:]    # two axes in the ground plane
    reach = math.ceil(TRUNCATE * config.context_scale * 2**(OCTAVES - 1) / cell)
    cells = np.floor(points @ across.T / cell).astype(np.int64)
    cells += reach - cells.min(axis=0, initial=0)
    column = np.full(256, -1, np.int64)
    present = [c for c in classes if (labels == c).any()]
    column[present] = np.arange(len(present))
    mapped = column[labels]
    occupied = np.zeros((*(cells.max(axis=0, initial=0) + reach + 1), len(present)), np.float32)
    seen = mapped >= 0
    occupied[cells[seen, 0], cells[seen, 1], mapped[seen]] = 1.0
    full = np.zeros((len(points), OCTAVES, len(classes)), np.float32)
    columns = [classes.index(c) for c in present]
    for octave in range(OCTAVES):
        sigma = config.context_scale * 2**octave / cell
        taps = np.arange(-math.ceil(TRUNCATE * sigma), math.ceil(TRUNCATE * sigma) + 1)
        kernel = np.exp(-0.5 * (taps / sigma)**2).astype(np.float32)
        kernel *= np.sqrt(sigma) / kernel.sum()    # far scales are thinner: keep their say
        full[:, octave, columns] = _blurred_at(occupied, kernel, cells)
    flat = np.sqrt(full.reshape(len(points), -1))
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.divide(flat, length, out=np.zeros_like(flat), where=length > 0)


@numba.njit(cache=True, nogil=True, parallel=True, fastmath=True)
def _blurred_at(occupied, kernel, cells):  # type: ignore[no-untyped-def]
    """Blur along one axis everywhere, along the other only where it is asked for."""
    nx, ny, nc = occupied.shape
    half = len(kernel) // 2
    rows = np.zeros((nx, ny, nc), np.float32)
    for x in numba.prange(half, nx - half):
        for t in range(len(kernel)):
            for y in range(ny):
                for c in range(nc):
                    rows[x, y, c] += kernel[t] * occupied[x + t - half, y, c]
    out = np.zeros((len(cells), nc), np.float32)
    for i in numba.prange(len(cells)):
        for t in range(len(kernel)):
            for c in range(nc):
                out[i, c] += kernel[t] * rows[cells[i, 0], cells[i, 1] + t - half, c]
    return out
