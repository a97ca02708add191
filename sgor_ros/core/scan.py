"""The way in (`SemanticScan`), what is made of it, and the way out (`Registration`)."""
from dataclasses import dataclass
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from .alignment import Surface
from .checks import as_labels
from .checks import as_points
from .checks import finite_rows
from .config import SgorConfig
from .correspondences import Features
from .evidence import View
from .ground import Ground
from .settings import InputError


@dataclass(frozen=True, eq=False, init=False)
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


@dataclass(frozen=True, eq=False)
class PreparedScan:
    """Everything of one scan that does not depend on the other: the result of `preprocess`.

    Attributes
    ----------
    scan : SemanticScan
        What it was made from.
    config : SgorConfig
        What it was made with.
    features : Features
        Keypoints with labels, descriptors and heights.
    ground : Ground or None
        None where no ground plane was found.
    view : View
        What it can say about transformations.
    surface : Surface or None
        Cloud for the local refinement; None where that is off or there are too few points.
    warnings : tuple of str
        What was odd about the scan, in words.
    timings : dict of str to float
        Stage to seconds.
    """

    scan: SemanticScan
    config: SgorConfig
    features: Features
    ground: Ground | None
    view: View
    surface: Surface | None
    warnings: tuple[str, ...]
    timings: dict[str, float]


@dataclass(frozen=True, eq=False)
class Registration:
    """What `register` found out.

    Attributes
    ----------
    success : bool
    reason : str
        Why not, in words; empty on success.
    T_target_source : (4, 4) float64 or None
        Maps source points into the target; None where there is not even a candidate. Without
        success it is the refused candidate, to look at and not to use.
    confidence : float
        0 to 1: evidence that the transformation is right.
    source_points, target_points : (K, 3) float64
        The correspondences, metres.
    inliers : (K,) bool
        Those that agree with the transformation.
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2.
    hypotheses : (H, 4, 4) float64
        Candidates of the groups, T_target_source.
    passed_ground_check : (H,) bool
        Which of them survived the first stage of verification.
    best_hypothesis : int
        Which of them won the second stage; -1 if none.
    source_ground, target_ground : Ground or None
    evidence : dict of str to float
        What the confidence was judged by.
    warnings : tuple of str
        What was odd about the scans, in words.
    timings : dict of str to float
        Stage to seconds.
    """

    success: bool
    reason: str
    T_target_source: NDArray[np.float64] | None
    source_points: NDArray[np.float64]
    target_points: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    confidence: float = 0.0
    covariance: NDArray[np.float64] | None = None
    hypotheses: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4, 4)))
    passed_ground_check: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    best_hypothesis: int = -1
    source_ground: Ground | None = None
    target_ground: Ground | None = None
    evidence: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)
