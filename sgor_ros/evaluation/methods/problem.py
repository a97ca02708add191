"""What a method of the tables is given, and what it returns."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Matches:
    """Putative matches of two clouds: the same for every method.

    Attributes
    ----------
    source, target : (N, 3) float64
        Row i of one is held to be the same place as row i of the other, metres.
    inlier_m : float
        A match is right below this distance: 0.6 outdoors, 0.1 indoors.
    source_labels, target_labels : (N,) int64, optional
        Ids of the label convention of the configuration.
    ground_normals : pair of (3,) float64, optional
        Of source and target, towards the sensor.
    """

    source: Array
    target: Array
    inlier_m: float
    source_labels: NDArray[np.int64] | None = None
    target_labels: NDArray[np.int64] | None = None
    ground_normals: tuple[Array, Array] | None = None


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
