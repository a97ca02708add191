"""Evidence of the clouds for or against a transformation (beyond the paper).

Under the right transformation the keypoints of one scan lie on surfaces of the other with the same
regional label (*agree*), and none hangs in the air that the other sensor has looked through (a
free-space violation: *contradict*). What the other sensor could not see says nothing. Both are
asked of both scans.
"""
from dataclasses import dataclass
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..common.threads import shared
from ..scan.labels import UNLABELLED
from ..scan.voxels import thin
from .view import direction
from .view import slot_of
from .view import View

AGREE, SILENT, CONTRADICT = 1, 0, -1

TANGENTIAL = 0.1
"""Share of a squared distance along the surface that counts: there, points lie where the beams
happened to hit."""
ON_SURFACE = 0.35
"""A point agrees within this share of the reach of a surface."""
MARGIN, MARGIN_SHARE = 0.5, 0.02
"""A point contradicts when it is nearer than all that was measured around its direction, by this
share of the reach and this share of the range."""
SEVERITY = 5.0
"""A contradiction weighs so many agreements: the right transformation has hardly any."""
DOUBT = 0.01
"""Share of keypoints that speaks against every transformation: a handful alone proves nothing."""
SAMPLE = 400
"""Keypoints asked for each hypothesis."""


@dataclass(frozen=True)
class Evidence:
    """Shares of the keypoints of both scans together.

    Attributes
    ----------
    agree : float
        Lie on a surface of the same label.
    contradict : float
        Hang where the other sensor has looked through.
    """

    agree: float
    contradict: float

    @property
    def confidence(self) -> float:
        """The weight of those that speak for it among those that speak, 0 to 1."""
        return self.agree / (self.agree + SEVERITY * self.contradict + DOUBT)


def evidence_of(outcomes: NDArray[np.int8]) -> Evidence:
    """Sum up the outcomes (n,) of all points that were asked."""
    asked = max(len(outcomes), 1)
    return Evidence(int((outcomes == AGREE).sum()) / asked,
                    int((outcomes == CONTRADICT).sum()) / asked)


def evidence(source: View, target: View, T_target_source: NDArray[np.float64]) -> Evidence:
    """Ask all keypoints of both scans about one (4, 4) transformation."""
    most = max(len(source.points), len(target.points))
    return evidence_of(testify(source, target, T_target_source[None], most)[0])


def testify(source: View, target: View, T_target_source: NDArray[np.float64],
            sample: int) -> NDArray[np.int8]:
    """Ask both scans about transformations.

    Parameters
    ----------
    T_target_source : (H, 4, 4) float64
    sample : int
        Keypoints to ask of each scan, evenly spread.

    Returns
    -------
    (H, n) int8
        `AGREE`, `SILENT` or `CONTRADICT`: those of the source, then those of the target.
    """
    inverse = np.array([se3.inverse(T) for T in T_target_source]).reshape(-1, 4, 4)
    return np.hstack((_ask(source, target, T_target_source, sample),
                      _ask(target, source, inverse, sample)))


def rank(source: View, target: View, T_target_source: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return agree minus contradict for each of rough (H, 4, 4), from a sample of the source."""
    outcomes = _ask(source, target, T_target_source, SAMPLE, rough=True)
    mean: NDArray[np.float64] = outcomes.mean(axis=1)
    return mean


def _ask(source: View, target: View, T: NDArray[np.float64], sample: int, *, rough: bool = False
         ) -> NDArray[np.int8]:
    rows = thin(len(source.points), sample)
    outcomes = np.zeros((len(T), len(rows)), np.int8)
    # roughly, whatever is in the cells around is a partner
    reach, near, margin = ((target.cell, target.cell, target.cell) if rough else
                           (target.reach, ON_SURFACE * target.reach, MARGIN * target.reach))
    shared(_outcomes, outcomes.size, source.points[rows], source.labels[rows],
           np.ascontiguousarray(T), target.points, target.normals, target.labels, target.cell,
           target.slots, target.chain, target.nearest, reach, near * near, margin, outcomes)
    return outcomes


@numba.njit(cache=True, nogil=True)
def _outcomes(first, last, points, labels, T, others, normals,
              other_labels, cell, slots, chain, nearest, reach, limit, margin, outcomes):
    for task in range(first, last):
        h, i = task // len(points), task % len(points)
        x = T[h, 0, 0] * points[i, 0] + T[h, 0, 1] * points[i, 1] + T[h, 0, 2] * points[i, 2] \
            + T[h, 0, 3]
        y = T[h, 1, 0] * points[i, 0] + T[h, 1, 1] * points[i, 1] + T[h, 1, 2] * points[i, 2] \
            + T[h, 1, 3]
        z = T[h, 2, 0] * points[i, 0] + T[h, 2, 1] * points[i, 1] + T[h, 2, 2] * points[i, 2] \
            + T[h, 2, 3]
        if _on_surface(x, y, z, labels[i], others, normals, other_labels, cell, slots, chain,
                       reach, limit):
            outcomes[h, i] = AGREE
            continue
        r = math.sqrt(x * x + y * y + z * z)
        if r > 0:
            a, e = direction(np.float32(x), np.float32(y), np.float32(z))
            # nothing measured there is no evidence
            if nearest[a, e] < np.inf and r < nearest[a, e] * (1 - MARGIN_SHARE) - margin:
                outcomes[h, i] = CONTRADICT


@numba.njit(cache=True, nogil=True)
def _on_surface(x, y, z, label, others, normals, other_labels, cell,
                slots, chain, reach, limit):
    """Return whether a surface of the same label is near, by `gap` below `limit`."""
    low, high, shift = cells_around(reach, cell)
    ix, iy, iz = (np.int64(np.floor(x / cell - shift)), np.int64(np.floor(y / cell - shift)),
                  np.int64(np.floor(z / cell - shift)))
    for dx in range(low, high):
        for dy in range(low, high):
            for dz in range(low, high):
                k = slots[slot_of(ix + dx, iy + dy, iz + dz, len(slots) - 1)]
                while k >= 0:
                    if alike(label, other_labels[k]):
                        a, b, c = x - others[k, 0], y - others[k, 1], z - others[k, 2]
                        squared = a * a + b * b + c * c
                        if squared <= reach * reach and gap(a, b, c, squared, normals[k]) <= limit:
                            return True
                    k = chain[k]
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


@numba.njit(cache=True, nogil=True, inline='always')
def cells_around(reach, cell):
    """Return the range of cells a ball can touch, and the shift that makes them so few.

    Eight for a ball of up to half a cell, 27 for a larger one.
    """
    return (0, 2, 0.5) if 2 * reach <= cell * (1 + 1e-9) else (-1, 2, 0.0)
