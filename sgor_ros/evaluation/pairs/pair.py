"""A pair to register, and the two forms in which methods are given it: scans and matches."""
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ...core.matching.correspondences import Correspondences
from ...core.matching.correspondences import given_correspondences
from ...core.scan.scan import SemanticScan
from ...io.datasets import DriveScan

Array = NDArray[np.float64]

INDOOR_M = 0.1
"""Up to this inlier threshold the settings of other methods are those for rooms."""


@dataclass(frozen=True, eq=False)
class Scans:
    """A pair as methods on raw scans are given it.

    Attributes
    ----------
    source, target : SemanticScan
    source_convention, target_convention : str
        What their labels mean.
    seed : int
        For methods that replace labels by random ones.
    """

    source: SemanticScan
    target: SemanticScan
    source_convention: str
    target_convention: str
    seed: int


@dataclass(frozen=True, eq=False)
class Matches:
    """A pair as methods on putative matches are given it: the same matches for each of them.

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


@dataclass(frozen=True, eq=False)
class Pair:
    """Two scans to register, or the matches of two. It can be sent to another process.

    Attributes
    ----------
    source, target : DriveScan or None
        None where there are matches in place of scans.
    T_target_source : (4, 4) float64 or None
        The truth; None where the scans are of different drives.
    same_place : bool
        Whether both scans see the same place, so that there is something to find.
    heights_known : bool
        Whether the truth is good in z; if not, errors in z do not count.
    name : str
        Its own within a protocol; default: the names of both scans.
    group : str
        What it is counted under: a data set (the default), a band of distance, a scene.
    matches : Matches or None
    """

    source: DriveScan | None
    target: DriveScan | None
    T_target_source: Array | None
    same_place: bool = True
    heights_known: bool = True
    name: str = ''
    group: str = ''
    matches: Matches | None = None

    def __post_init__(self) -> None:
        if self.source is not None and self.target is not None:
            object.__setattr__(self, 'name',
                               self.name or f'{self.source.name} {self.target.name}')
            object.__setattr__(self, 'group', self.group or ' x '.join(
                sorted({self.source.data_set, self.target.data_set})))

    @property
    def scans(self) -> tuple[DriveScan, DriveScan]:
        """Source and target of a pair that has scans."""
        assert self.source is not None
        assert self.target is not None
        return self.source, self.target

    @property
    def distance_m(self) -> float:
        """Distance of the sensors; NaN for different drives."""
        return (float('nan') if self.T_target_source is None
                else float(np.linalg.norm(self.T_target_source[:3, 3])))
