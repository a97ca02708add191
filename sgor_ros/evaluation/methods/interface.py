"""What a method is given, raw scans or shared matches, and the one answer that it returns."""
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
from ...core.scan.scan import SemanticScan
from ...core.verdict.result import Registration

Array = NDArray[np.float64]

INDOOR_M = 0.1
"""Up to this inlier threshold the settings of the relatives are those for rooms."""


@dataclass(frozen=True, eq=False)
class ScanPair:
    """Two raw scans.

    Attributes
    ----------
    source, target : SemanticScan
    source_convention, target_convention : str
        What their labels mean.
    seed : int
        For methods that spoil labels.
    """

    source: SemanticScan
    target: SemanticScan
    source_convention: str
    target_convention: str
    seed: int


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


class Answer(NamedTuple):
    """What a method made of a pair.

    Attributes
    ----------
    T_target_source : (4, 4) float64 or None
        None where it found nothing.
    kept : (K,) array of int or None
        Matches that it holds to be right; None: those that fit T to `inlier_m`.
    seconds : float
        From what it was given to the transformation; NaN: whoever calls it takes the time.
    valid : bool
        Whether the method itself trusts it.
    score : float
        By what it judged: confidence, inliers or fitness.
    seconds_one_new : float
        With one of the scans prepared before; NaN where a method cannot do that.
    result : Registration or None
        All that SGOR returns; None of other methods.
    """

    T_target_source: Array | None
    kept: NDArray[np.intp] | None = None
    seconds: float = float('nan')
    valid: bool = True
    score: float = float('nan')
    seconds_one_new: float = float('nan')
    result: Registration | None = None


OnScans = Callable[[ScanPair], Answer]
OnMatches = Callable[[Matches], Answer]


@dataclass(frozen=True, eq=False)
class Method:
    """A method by its name in tables; what it holds can be sent to another process.

    Attributes
    ----------
    name : str
    on_scans, on_matches : callable or None
        One of them: whether it is given raw scans or shared matches.
    refuses : bool
        Whether some answers are not `valid`.
    front_end : SgorConfig or None
        Makes its matches; None: that of the protocol.
    package : str
        What has to be installed for it; empty: nothing.
    """

    name: str
    on_scans: OnScans | None = None
    on_matches: OnMatches | None = None
    refuses: bool = True
    front_end: SgorConfig | None = None
    package: str = ''
