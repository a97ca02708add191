"""The keypoints of one scan, and what is known of each (Sec. III-B)."""
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..scan.labels import UNLABELLED

Rows = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Features:
    """The keypoints of one scan that may be matched.

    Attributes
    ----------
    points : (V, 3) float64
        Metres.
    labels, regional : (V,) uint8
        Class inside by vote of the voxel, and of the neighbourhood.
    described : (V, D) float32 or callable
        The `descriptors`, or what makes them: they take a third of the time of a scan, and not
        each scan is matched.
    heights : (V,) float64 or None
        Heights over the ground plane, metres; None without a ground plane.
    surrounded : (V, E) float32 or callable or None
        The `context`, or what makes it; None without a ground plane or where it is off.
    """

    points: NDArray[np.float64]
    labels: NDArray[np.uint8]
    regional: NDArray[np.uint8]
    described: Rows | Callable[[], Rows]
    heights: NDArray[np.float64] | None = None
    surrounded: Rows | Callable[[], Rows] | None = None

    @cached_property
    def descriptors(self) -> Rows:
        """Unit rows, (V, D) float32; made when first asked for."""
        return self.described() if callable(self.described) else self.described

    @cached_property
    def context(self) -> Rows | None:
        """From `context.semantic_context`, (V, E) float32 or None; made when first asked for."""
        return self.surrounded() if callable(self.surrounded) else self.surrounded

    @property
    def labelled_share(self) -> float:
        """The share of the keypoints whose neighbourhood has a label; 0 without keypoints."""
        return float(np.count_nonzero(self.regional != UNLABELLED)) / max(len(self.regional), 1)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> 'Features':
        return Features(self.points[rows], self.labels[rows], self.regional[rows],
                        partial(_rows_of, self, 'descriptors', rows),
                        None if self.heights is None else self.heights[rows],
                        None if self.surrounded is None else
                        partial(_rows_of, self, 'context', rows))


def _rows_of(features: Features, name: str, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Rows:
    found: Rows = getattr(features, name)[rows]
    return found
