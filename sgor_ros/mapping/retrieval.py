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
FEW = 4000
"""Up to so many keyframes all are compared; of more a shortlist,"""
SHORTLIST = 500
"""so long, by their coordinates along"""
AXES = 64
"""principal axes, which so many rows tell:"""
SAMPLE = 4000


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
    """The descriptors of all keyframes, in rows of one matrix.

    Where there are many, those to compare are found by their coordinates along the few axes in
    which the rows differ most (principal component analysis), a twentieth of the work.
    """

    def __init__(self) -> None:
        self._ids: list[int] = []
        self._row: dict[int, int] = {}
        self._rows = np.empty((0, 0), np.float32)
        self._axes = np.empty((0, 0), np.float32)
        self._fitted = 0
        self._coarse = np.empty((0, AXES), np.float32)

    def add(self, keyframe: int, descriptor: Descriptor) -> None:
        """Remember one more, or another descriptor of one."""
        row = self._row.setdefault(keyframe, len(self._ids))
        if row < len(self._ids):
            self._rows[row] = descriptor
            self._coarse = self._coarse[:row]
            return
        count = len(self._ids)
        if count == len(self._rows):
            self._rows = _grown(self._rows, count, len(descriptor))
        self._rows[count] = descriptor
        self._ids.append(keyframe)

    def alike(self, descriptor: Descriptor, most: int | None = None) -> dict[int, float]:
        """Return keyframes with their likeness, those that look most alike first.

        Parameters
        ----------
        descriptor : (D,) float32
        most : int, optional
            So many of them, found quickly; without it all are returned.
        """
        count = len(self._ids)
        if not count:
            return {}
        if most is None or count <= FEW:
            rows, likeness = np.arange(count), self._rows[:count] @ descriptor
        else:
            rows = self._shortlist(descriptor, max(most, SHORTLIST))
            likeness = self._rows[rows] @ descriptor
        order = np.argsort(-likeness)[:most]
        return {self._ids[row]: found for row, found in zip(
            rows[order].tolist(), likeness[order].tolist(), strict=True)}

    def _shortlist(self, descriptor: Descriptor, most: int) -> NDArray[np.intp]:
        """Return the rows that are nearest along the principal axes."""
        count, done = len(self._ids), len(self._coarse)
        if not len(self._axes) or count > 2 * self._fitted:
            sample = self._rows[:count:-(-count // SAMPLE)].astype(np.float64)
            self._axes = np.linalg.eigh(sample.T @ sample)[1][:, -AXES:].astype(np.float32)
            self._fitted, done = count, 0
        if done < count:
            self._coarse = np.concatenate((self._coarse[:done],
                                           self._rows[done:count] @ self._axes))
        likeness = self._coarse @ (descriptor @ self._axes)
        return np.argpartition(-likeness, most)[:most]


def _grown(rows: NDArray[np.float32], count: int, width: int) -> NDArray[np.float32]:
    grown = np.empty((max(64, 2 * count), width), np.float32)
    grown[:count] = rows[:count] if count else 0
    return grown
