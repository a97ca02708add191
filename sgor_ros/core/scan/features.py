"""The keypoints of one scan, and what is known of each (Sec. III-B)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .labels import UNLABELLED


@dataclass(frozen=True, eq=False)
class Features:
    """The keypoints of one scan that may be matched.

    Attributes
    ----------
    points : (V, 3) float64
        Metres.
    labels, regional : (V,) uint8
        Class inside by vote of the voxel, and of the neighbourhood.
    descriptors : (V, D) float32
        Unit rows.
    heights : (V,) float64 or None
        Heights over the ground plane, metres; None without a ground plane.
    context : (V, E) float32 or None
        From `context.semantic_context`; None without a ground plane or where it is off.
    """

    points: NDArray[np.float64]
    labels: NDArray[np.uint8]
    regional: NDArray[np.uint8]
    descriptors: NDArray[np.float32]
    heights: NDArray[np.float64] | None = None
    context: NDArray[np.float32] | None = None

    @property
    def labelled_share(self) -> float:
        """The share of the keypoints whose neighbourhood has a label; 0 without keypoints."""
        return float(np.count_nonzero(self.regional != UNLABELLED)) / max(len(self.regional), 1)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> 'Features':
        return Features(self.points[rows], self.labels[rows], self.regional[rows],
                        self.descriptors[rows],
                        None if self.heights is None else self.heights[rows],
                        None if self.context is None else self.context[rows])
