"""What a method of the tables is given, and what it returns."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ...core.matching.correspondences import Correspondences
from ...core.matching.correspondences import given_correspondences

Array = NDArray[np.float64]


INDOOR_M = 0.1
"""Up to this inlier threshold the settings of the relatives are those for rooms."""


@dataclass(frozen=True, eq=False)
class Matches:
    """Putative matches of two clouds: the same for every method.

    Attributes
    ----------
    correspondences : Correspondences
        With the labels of both ends.
    inlier_m : float
        A match is right below this distance: 0.6 outdoors, 0.1 indoors.
    ground_normals : pair of (3,) float64 or None
        Of source and target, towards the sensor.
    """

    correspondences: Correspondences
    inlier_m: float
    ground_normals: tuple[Array, Array] | None = None

    @property
    def source(self) -> Array:
        """(N, 3) points of the source, metres."""
        return self.correspondences.source

    @property
    def target(self) -> Array:
        """(N, 3) points of the target: row i is held to be the same place as source row i."""
        return self.correspondences.target

    @classmethod
    def of(cls, source: ArrayLike, target: ArrayLike, inlier_m: float) -> Self:
        """Return matches of (N, 3) arrays, without labels."""
        return cls(given_correspondences(source, target, None, None, SgorConfig()), inlier_m)


class Solution(NamedTuple):
    """What a method made of them.

    Attributes
    ----------
    T_target_source : (4, 4) float64 or None
        None where it found nothing.
    kept : (K,) array of int or None
        Matches that it holds to be right; None: those that fit T to `inlier_m`.
    """

    T_target_source: Array | None
    kept: NDArray[np.intp] | None = None


Method = Callable[[Matches], Solution]
