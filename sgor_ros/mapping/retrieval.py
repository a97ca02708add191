"""Which keyframes look alike, whichever way the sensor was turned: place recognition.

It only proposes: whether two scans are of one place is decided by registering them.
"""
import numpy as np
from numpy.typing import NDArray

from ..core.common.products import times_transposed
from ..core.prepared_scan import PreparedScan
from ..core.scan.labels import UNLABELLED

Descriptor = NDArray[np.float32]

RINGS, RING_M = 12, 5.0
"""Rings around the sensor and their width; it has to tolerate sensors some metres apart."""
SECTORS = 120
HARMONICS = 8
"""Waves around the sensor whose strengths are compared: their phases hold the yaw."""
HEIGHTS_M = (1.0, 2.5, 5.0)
"""Borders between bands of height over the ground."""
LABELS = 8
"""Channels of labels, of which several may share one."""


def describe(prepared: PreparedScan) -> Descriptor:
    """Return what a place looks like from above, ground removed, whatever the yaw.

    Which cells of a polar grid hold something, by height and by label; of each ring the
    magnitudes of the Fourier transform around the sensor, which a turn does not change.

    Returns
    -------
    (D,) float32
        Of unit length. The product of two is their likeness, 1 for the same.
    """
    index, scale = prepared.index, prepared.scale
    placed = times_transposed(index.points, index.axes)
    heights = placed[:, 2] if prepared.features.heights is None else prepared.features.heights
    ring = np.hypot(placed[:, 0], placed[:, 1]) / (RING_M * scale) - 0.5
    sector = np.floor(np.arctan2(placed[:, 1], placed[:, 0]) / (2 * np.pi) * SECTORS)
    band = np.digitize(heights, np.array(HEIGHTS_M) * scale)
    geometry = _strengths(ring, sector, band, len(HEIGHTS_M) + 1)
    known = index.labels != UNLABELLED
    labels = _strengths(ring[known], sector[known], index.labels[known] % LABELS, LABELS)
    both = np.concatenate((_unit(geometry), _unit(labels)))
    return _unit(both)


def _strengths(ring: NDArray[np.float64], sector: NDArray[np.float64], channel: NDArray[np.int_],
               channels: int) -> NDArray[np.float32]:
    """Return the magnitudes of the lowest waves of each channel and ring."""
    cells = np.zeros((channels, RINGS + 2, SECTORS), np.float32)
    below = np.floor(ring).astype(np.int64)
    share = (ring - below).astype(np.float32)
    inside = below < RINGS
    columns = sector.astype(np.int64) % SECTORS
    # a point between the middles of two rings counts in both
    for row, weight in ((below + 1, 1 - share), (below + 2, share)):
        np.maximum.at(cells, (channel[inside], row[inside], columns[inside]), weight[inside])
    waves = np.abs(np.fft.rfft(cells[:, 1:-1], axis=-1)[..., :HARMONICS])
    return waves.astype(np.float32).ravel()


def _unit(vector: NDArray[np.float32]) -> NDArray[np.float32]:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)


class Retrieval:
    """The descriptors of all keyframes, in rows of one matrix."""

    def __init__(self) -> None:
        self._ids: list[int] = []
        self._rows = np.empty((0, 0), np.float32)

    def add(self, keyframe: int, descriptor: Descriptor) -> None:
        """Remember one more, or another descriptor of one."""
        if keyframe in self._ids:
            self._rows[self._ids.index(keyframe)] = descriptor
            return
        count = len(self._ids)
        if count == len(self._rows):
            grown = np.empty((max(64, 2 * count), len(descriptor)), np.float32)
            grown[:count] = self._rows[:count] if count else 0
            self._rows = grown
        self._rows[count] = descriptor
        self._ids.append(keyframe)

    def alike(self, descriptor: Descriptor) -> list[int]:
        """Return all keyframes, those that look most alike first."""
        if not self._ids:
            return []
        likeness = self._rows[:len(self._ids)] @ descriptor
        return [self._ids[row] for row in np.argsort(-likeness)]
