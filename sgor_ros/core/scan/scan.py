"""One scan as it comes in: points and labels (`SemanticScan`)."""
from copy import copy
from dataclasses import dataclass
from typing import Any
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..common.checks import as_labels
from ..common.checks import as_numbers
from ..common.checks import finite_rows
from ..common.settings import InputError
from .point_clouds import points_and_labels

ORIGIN = np.zeros(3)
"""Where the sensor is, as a rule."""
LONGEST_SWEEP = 10.0
"""Seconds: no sensor takes longer, and stamps of another clock are no times of points."""
ROUNDED = 1e-3
"""Metres: what is told of rounding to float32, which begins some 10 km from the origin."""


class PointCloud(Protocol):
    """What has points, as a cloud of Open3D."""

    @property
    def points(self) -> Any:
        """Return the points, (N, 3)."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class SemanticScan:
    """One scan: points and, where there are any, their labels.

    Both are copies, so that a caller may fill the same buffer with the next scan.

    Parameters
    ----------
    points : (N, 3) or (N, 4) array of numbers, structured array, tensor, or Open3D cloud
        Metres, in the sensor frame. Rows that are not finite are dropped, with their labels. A
        fourth column, intensity, is left out. A structured array has the fields x, y and z.
    labels : (N,) array of integers, optional
        Ids of the configured label convention. Default: a field `label`, `class_id` or the like
        of a structured array; else there are none.
    origin : (3,) array, optional
        Where the sensor is in the frame of the points, metres: for clouds in the frame of the
        vehicle, or of a map. Default: at the origin.
    up : (3,) array, optional
        Which way is up in that frame, from the mount or gravity, to within 30 degrees. Without
        it the scan itself has to tell.
    times : (N,) array of numbers, optional
        When each point was taken, seconds since the stamp of the scan, where the sensor moves
        while it sweeps: the tracker takes the bend out. `register` by itself does not.

    Raises
    ------
    InputError
        Wrong shape or type; labels or times of another length; no finite point; an `up` without
        length; times that are not finite or beyond `LONGEST_SWEEP`.
    """

    points: NDArray[np.float32]
    labels: NDArray[np.int64] | None
    origin: NDArray[np.float64]
    up: NDArray[np.float64] | None
    """Of length one."""
    times: NDArray[np.float64] | None
    rounding: float
    """How far off half of the points are at least for being kept as float32, metres; 0: little."""

    def __init__(self, points: ArrayLike | PointCloud, labels: ArrayLike | None = None, *,
                 origin: ArrayLike | None = None, up: ArrayLike | None = None,
                 times: ArrayLike | None = None) -> None:
        exact, found = points_and_labels(points)
        labels = found if labels is None else labels
        with np.errstate(over='ignore'):
            clean = exact.astype(np.float32, order='C')
        ids = None if labels is None else as_labels(labels, len(clean), 'labels').copy()
        taken = None if times is None else _times(times, len(clean))
        finite = finite_rows(clean)
        if not finite.any():
            raise InputError(f'points: none of {len(clean)} is finite' if len(clean)
                             else 'points: the scan is empty')
        if not finite.all():
            exact, clean = exact[finite], clean[finite]
            ids = None if ids is None else ids[finite]
            taken = None if taken is None else taken[finite]
        if taken is not None and (bad := ~(np.abs(taken) < LONGEST_SWEEP)).any():
            raise InputError(f'times: {taken[np.argmax(bad)]:g}, expected seconds, within '
                             f'{LONGEST_SWEEP:g} of the stamp')
        object.__setattr__(self, 'points', clean)
        object.__setattr__(self, 'labels', ids)
        object.__setattr__(self, 'origin',
                           ORIGIN if origin is None else _vector(origin, 'origin'))
        object.__setattr__(self, 'up', None if up is None else _unit(_vector(up, 'up'), 'up'))
        object.__setattr__(self, 'times', taken)
        object.__setattr__(self, 'rounding', _rounding(exact, clean))

    def mounted(self, *, up: ArrayLike, origin: ArrayLike | None = None) -> 'SemanticScan':
        """Return the same scan where the mount of the sensor is known; what it says itself stays.

        Parameters
        ----------
        up, origin : (3,) array
            As of the class.
        """
        known = copy(self)    # the same points
        if self.up is None:
            object.__setattr__(known, 'up', _unit(_vector(up, 'up'), 'up'))
        if origin is not None and not self.origin.any():
            object.__setattr__(known, 'origin', _vector(origin, 'origin'))
        return known

    def with_points(self, points: NDArray[np.float32]) -> 'SemanticScan':
        """Return the same scan with (N, 3) other points, all of them taken at its stamp."""
        other = copy(self)
        object.__setattr__(other, 'points', points)
        object.__setattr__(other, 'times', None)
        return other

    def seen_from_sensor(self, points: NDArray[Any]) -> NDArray[Any]:
        """Return (N, 3) points of its frame relative to the sensor, metres."""
        if not self.origin.any():
            return points
        moved: NDArray[Any] = points - self.origin.astype(points.dtype)
        return moved

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        labels = '' if self.labels is None else f', {len(np.unique(self.labels))} label ids'
        return f'SemanticScan({len(self)} points{labels})'


def _times(value: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return a copy of (N,) times.

    Raises
    ------
    InputError
        They are none.
    """
    times = as_numbers(value, 'times').astype(np.float64)
    if times.shape != (count,):
        raise InputError(f'times: expected shape ({count},), got {times.shape}')
    return times


def _vector(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return a copy of a finite (3,) vector.

    Raises
    ------
    InputError
        It is none.
    """
    vector = as_numbers(value, name).astype(np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f'{name}: expected 3 finite numbers, got {vector.tolist()}')
    return vector


def _unit(vector: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    length = np.linalg.norm(vector)
    if length == 0:
        raise InputError(f'{name}: has no length')
    return vector / length


def _rounding(exact: NDArray[Any], kept: NDArray[np.float32]) -> float:
    """Return the median error of points, metres, where it may be more than `ROUNDED`."""
    largest = max(float(kept.max()), -float(kept.min()))
    if exact.dtype == np.float32 or np.spacing(np.float32(largest)) < ROUNDED:
        return 0.0
    return float(np.median(np.abs(exact - kept.astype(np.float64)).max(axis=1)))


def rounding_warning(scan: SemanticScan) -> str:
    """Say that the coordinates are too large to be kept well; empty: they are not."""
    if scan.rounding <= ROUNDED:
        return ''
    return (f'points: rounded to float32 as they are kept, half of them by {scan.rounding:.2g} m '
            'and more: subtract the position of the sensor first, as in the frame of the sensor')
