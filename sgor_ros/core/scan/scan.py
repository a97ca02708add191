"""One scan as it comes in: points and labels (`SemanticScan`)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..common.checks import as_labels
from ..common.checks import as_points
from ..common.checks import finite_rows
from ..common.settings import InputError


@dataclass(frozen=True, eq=False, init=False, repr=False)
class SemanticScan:
    """One scan: points and, where there are any, their labels.

    Parameters
    ----------
    points : (N, 3) array of numbers
        Metres, in the sensor frame. Rows that are not finite are dropped, with their labels.
    labels : (N,) array of integers, optional
        Ids of the configured label convention.

    Raises
    ------
    InputError
        Wrong shape or type; labels of another length; no finite point.
    """

    points: NDArray[np.float32]
    labels: NDArray[np.int64] | None

    def __init__(self, points: ArrayLike, labels: ArrayLike | None = None) -> None:
        clean = as_points(points, 'points', np.float32)
        ids = None if labels is None else as_labels(labels, len(clean), 'labels')
        finite = finite_rows(clean)
        if not finite.any():
            raise InputError(f'points: none of {len(clean)} is finite' if len(clean)
                             else 'points: the scan is empty')
        if not finite.all():
            clean, ids = clean[finite], None if ids is None else ids[finite]
        object.__setattr__(self, 'points', np.ascontiguousarray(clean))
        object.__setattr__(self, 'labels', ids)

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        labels = '' if self.labels is None else f', {len(np.unique(self.labels))} label ids'
        return f'SemanticScan({len(self)} points{labels})'
