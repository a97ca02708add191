"""How large the space is that a scan shows: the factor of all lengths (beyond the paper)."""
import math

import numpy as np
from numpy.typing import NDArray

from ..common.products import scatter

STREET_VOXEL = 0.5
"""Metres: the grid on which sizes compare, whatever the sensor's density."""
STREET_SIZE = 7.0
"""Metres: streets have 12 to 30, courtyards 5 to 9, corridors 4 to 5, fragments of rooms 0.7."""
SMALLEST = 1 / 16
"""Voxels of 3 cm; nothing finer is seen of rooms by depth cameras."""
SAMPLE = 2000
"""Points that are asked how far they spread."""
KEPT = 0.75
"""Octaves around a scale that is kept, where a half would do: so that a drive does not flip."""


def size_of(points: NDArray[np.float64]) -> float:
    """Return the root of the area over which (V, 3) thinned points spread, metres.

    That is the geometric mean of the two largest standard deviations: it needs no upright, and
    neither a long street nor a wide yard is small, but a corridor is.
    """
    if len(points) < 3:
        return STREET_SIZE
    points = points[::max(len(points) // SAMPLE, 1)]
    centred = points - points.mean(axis=0)    # a quarter of the time of np.cov
    variances = np.linalg.eigvalsh(scatter(centred) / len(points))
    return math.sqrt(math.sqrt(max(float(variances[1] * variances[2]), 0.0)))


def scale_of(points: NDArray[np.float64], before: float | None = None) -> float:
    """Return the scale of a space: 1 for streets and all that is larger, or 1/2, 1/4 and so on.

    Parameters
    ----------
    points : (V, 3) float64
        Thinned to `STREET_VOXEL`, metres.
    before : float, optional
        A scale to keep where it fits nearly as well, such as that of the scan before.
    """
    octave = math.log2(max(size_of(points), 1e-3) / STREET_SIZE)
    if before is not None and abs(octave - math.log2(before)) <= KEPT:
        return before
    return float(min(max(2.0**round(octave), SMALLEST), 1.0))
