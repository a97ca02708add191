"""The way in (`SemanticScan`), and what is made of it (`PreparedScan`)."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..alignment import Surface
from ..common.checks import as_labels
from ..common.checks import as_points
from ..common.checks import finite_rows
from ..common.settings import InputError
from ..config import SgorConfig
from ..trust.view import View
from .features import Features
from .ground import Ground

Given = tuple[ArrayLike | None, ArrayLike | None]
"""Keypoints and descriptors of the caller, before they are checked."""


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


@dataclass(frozen=True, eq=False, repr=False)
class PreparedScan:
    """Everything of one scan that does not depend on the other: the result of `preprocess`.

    Attributes
    ----------
    scan : SemanticScan
        What it was made from.
    config : SgorConfig
        What it was made with, but for the scale.
    scale : float
        What the lengths of the configuration were multiplied by.
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
    given : pair of arrays or None
        Keypoints and descriptors of the caller.
    """

    scan: SemanticScan
    config: SgorConfig
    scale: float
    features: Features
    ground: Ground | None
    view: View
    surface: Surface | None
    warnings: tuple[str, ...]
    timings: dict[str, float]
    given: Given | None = None

    def __repr__(self) -> str:
        return (f'PreparedScan({self.scan}, {len(self.features.points)} keypoints, '
                f'scale {self.scale:g})')


def as_scan(scan: SemanticScan | PreparedScan | ArrayLike,
            name: str) -> SemanticScan | PreparedScan:
    """Return a scan as it is, and (N, 3) points as one without labels.

    Raises
    ------
    InputError
        Naming `name`, what is neither.
    """
    if isinstance(scan, SemanticScan | PreparedScan):
        return scan
    try:
        return SemanticScan(scan)
    except InputError as error:
        raise InputError(f'{name}: neither a SemanticScan nor an (N, 3) array of points '
                         f'({error})') from error
