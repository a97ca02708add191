"""Pose scoring by the clouds: overlap and free-space violations (beyond the paper).

Under the right pose the keypoints of one scan lie on surfaces of the other with the same regional
label (*overlap*), and none hangs in the air that the other sensor has looked through (a
*free-space violation*). What the other sensor could not see counts for neither. Both are counted
over the keypoints of both scans.
"""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..execution.threads import parallel_for
from ..index.columns import window
from ..index.scan_index import ScanIndex
from ..scan.directions import direction
from ..scan.labels import UNLABELLED
from ..scan.voxels import thin
from .calibration import probability

AGREES, UNOBSERVED, VIOLATES = 1, 0, -1
"""Outcomes of a keypoint: on a surface, not seen by the other sensor, in free space."""

TANGENTIAL = 0.1
"""Share of a squared distance along the surface that counts: there, points lie where the beams
happened to hit."""
ON_SURFACE = 0.35
"""A point agrees within this share of the maximum correspondence distance of a surface."""
MARGIN, MARGIN_SHARE = 0.5, 0.02
"""A point violates free space when it is nearer than all that was measured around its direction,
by this share of the maximum correspondence distance and this share of the range."""
VIOLATION_WEIGHT = 5.0
"""A violation weighs so many agreements where poses are ranked: the right one has hardly any."""
ROUGH_KEYPOINTS = 400
"""Keypoints scored for each hypothesis of the solver."""


@dataclass(frozen=True)
class PoseScore:
    """Shares of the keypoints of both scans together.

    Attributes
    ----------
    overlap : float
        Lie on a surface of the same label.
    violations : float
        Hang where the other sensor has looked through.
    """

    overlap: float
    violations: float

    @property
    def confidence(self) -> float:
        """The probability that the pose is right where no other competes with it, 0 to 1."""
        return probability(self.overlap, self.violations)


def pose_score(outcomes: NDArray[np.int8]) -> PoseScore:
    """Sum up the outcomes (n,) of keypoints."""
    asked = max(len(outcomes), 1)
    return PoseScore(int((outcomes == AGREES).sum()) / asked,
                     int((outcomes == VIOLATES).sum()) / asked)


def score_keypoints(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64],
                    keypoints: int) -> NDArray[np.int8]:
    """Score keypoints of both scans under poses.

    Parameters
    ----------
    source, target : ScanIndex
    T_target_source : (H, 4, 4) float64
    keypoints : int
        How many of each scan, evenly spread.

    Returns
    -------
    (H, n) int8
        `AGREES`, `UNOBSERVED` or `VIOLATES`: those of the source, then those of the target.
    """
    inverse = np.array([se3.inverse(T) for T in T_target_source]).reshape(-1, 4, 4)
    return np.hstack((_one_way(source, target, T_target_source, keypoints),
                      _one_way(target, source, inverse, keypoints)))


def rough_scores(source: ScanIndex, target: ScanIndex, T_target_source: NDArray[np.float64]
                 ) -> NDArray[np.float64]:
    """Return overlap minus violations of (H, 4, 4) rough poses, by keypoints of the source."""
    mean: NDArray[np.float64] = _one_way(source, target, T_target_source, ROUGH_KEYPOINTS,
                                         rough=True).mean(axis=1)
    return mean


def _one_way(source: ScanIndex, target: ScanIndex, T: NDArray[np.float64], keypoints: int, *,
             rough: bool = False) -> NDArray[np.int8]:
    rows = thin(len(source.points), keypoints)
    outcomes = np.zeros((len(T), len(rows)), np.int8)
    # roughly, whatever is around is a partner
    most, wide = target.max_distance, 2 * target.max_distance
    reach, near, margin = ((wide, wide, wide) if rough else
                           (most, ON_SURFACE * most, MARGIN * most))
    columns = target.columns
    parallel_for(_outcomes, outcomes.size, source.points[rows], source.labels[rows],
                 np.ascontiguousarray(T), columns.points, target.column_normals,
                 target.column_labels, columns.first, columns.ny, columns.low, columns.edge,
                 target.ranges, target.origin, reach, near * near, margin, outcomes)
    return outcomes


@numba.njit(cache=True, nogil=True)
def _outcomes(first, last, points, labels, T, others, normals,
              other_labels, columns, ny, low, edge, ranges, origin, reach, limit, margin,
              outcomes):
    for task in range(first, last):
        h, i = task // len(points), task % len(points)
        x = T[h, 0, 0] * points[i, 0] + T[h, 0, 1] * points[i, 1] + T[h, 0, 2] * points[i, 2] \
            + T[h, 0, 3]
        y = T[h, 1, 0] * points[i, 0] + T[h, 1, 1] * points[i, 1] + T[h, 1, 2] * points[i, 2] \
            + T[h, 1, 3]
        z = T[h, 2, 0] * points[i, 0] + T[h, 2, 1] * points[i, 1] + T[h, 2, 2] * points[i, 2] \
            + T[h, 2, 3]
        if _on_surface(x, y, z, labels[i], others, normals, other_labels, columns, ny, low, edge,
                       reach, limit):
            outcomes[h, i] = AGREES
            continue
        x, y, z = x - origin[0], y - origin[1], z - origin[2]
        r = math.sqrt(x * x + y * y + z * z)
        if r > 0:
            a, e = direction(np.float32(x), np.float32(y), np.float32(z))
            # nothing measured there is no evidence
            if ranges[a, e] < np.inf and r < ranges[a, e] * (1 - MARGIN_SHARE) - margin:
                outcomes[h, i] = VIOLATES


@numba.njit(cache=True, nogil=True)
def _on_surface(x, y, z, label, others, normals, other_labels,
                columns, ny, low, edge, reach, limit):
    """Return whether a surface of the same label is near, by `gap` below `limit`."""
    x_first, x_last = window(x, reach, low[0], edge, (len(columns) - 1) // ny)
    y_first, y_last = window(y, reach, low[1], edge, ny)
    for column in range(x_first * ny, x_last * ny, ny):
        for k in range(columns[column + y_first], columns[column + y_last]):
            a, b, c = x - others[k, 0], y - others[k, 1], z - others[k, 2]
            squared = a * a + b * b + c * c
            if (squared <= reach * reach and alike(label, other_labels[k])
                    and gap(a, b, c, squared, normals[k]) <= limit):
                return True
    return False


@numba.njit(cache=True, nogil=True, inline='always')
def alike(one, other):
    """Return whether two regional labels may be of one thing; the unlabelled may be anything."""
    return one == other or min(one, other) == UNLABELLED


@numba.njit(cache=True, nogil=True, inline='always')
def gap(a, b, c, squared, normal):
    """Return the squared distance to a surface: full across it, a share of it along it."""
    across = a * normal[0] + b * normal[1] + c * normal[2]
    return across * across * (1 - TANGENTIAL) + TANGENTIAL * squared
