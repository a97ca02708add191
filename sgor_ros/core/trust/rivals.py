"""Rivals: the other placements of the source that the clouds may not rule out (beyond the paper).

Where places repeat (perceptual aliasing) a wrong transformation explains the clouds as well as the
right one, and no evidence for one of them alone can tell. So others are looked for far away: where
the label maps of both scans, seen from above, correlate for some shift and quarter turn, and among
the hypotheses of the solver. Each is fitted by ICP and asked the same questions.

A rival is ruled out by free space: where it lays points into what the other sensor has looked
through, and the answer does not. What every placement explains, walls and road, says nothing.
"""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common import se3
from .comparison import apart
from .comparison import differ
from .comparison import exclusive
from .comparison import ruled_out
from .comparison import winner
from .correlation import correlated
from .degeneracy import is_shift
from .degeneracy import PUSH
from .degeneracy import pushed
from .degeneracy import PUSHES
from .degeneracy import Slide
from .degeneracy import weak_directions
from .degeneracy import without_slides
from .evidence import AGREE
from .evidence import testify
from .icp import icp
from .ridges import along_ridges
from .view import View

HYPOTHESES = 6
"""Placements taken from the hypotheses of the solver."""
WIDE, NARROW = 3, 4
"""Rounds of ICP for each rival."""
LATE = 10
"""Rounds of either kind for the few that nothing has ruled out by then."""
FEW, MANY = 250, 1000
"""Keypoints of each scan asked first, and where that does not rule a rival out."""
STAYS = 0.8
"""A direction is free where a push along it is kept to this share: elsewhere the clouds slide
back."""
LEVEL = np.cos(np.radians(10.0))
"""Least cosine of the ground normals under a rival: slopes and their estimates included."""


@dataclass(frozen=True, eq=False)
class Contest:
    """A placement and those that compete with it.

    Attributes
    ----------
    T_target_source : (4, 4) float64
        The placement that no other one beats.
    outcomes : (n,) int8
        What both scans say of it, see `testify`.
    rivals : (K, 4, 4) float64
        Other placements that are not ruled out, best first.
    rival_outcomes : (K, n) int8
    slides : tuple of Slide
        Directions in which the clouds slide.
    weak : bool
        Whether the surfaces hold any direction so little that it had to be tried.
    """

    T_target_source: NDArray[np.float64]
    outcomes: NDArray[np.int8]
    rivals: NDArray[np.float64]
    rival_outcomes: NDArray[np.int8]
    slides: tuple[Slide, ...] = ()
    weak: bool = False


def contest(source: View, target: View, T_target_source: NDArray[np.float64],
            hypotheses: NDArray[np.float64], radius: float, *, again: bool = True) -> Contest:
    """Fit a placement, look for its rivals up to `radius` metres away, and let the best one win.

    Parameters
    ----------
    T_target_source : (4, 4) float64
    hypotheses : (H, 4, 4) float64
        Other candidates, best first.
    again : bool
        Whether a rival that wins is to face its own rivals too.
    """
    T = icp(source, target, T_target_source[None], WIDE, NARROW)[0]
    weak, lever = weak_directions(source, target, T)
    pushes = PUSH * target.reach * np.vstack((weak, -weak))
    others = icp(source, target, np.concatenate((
        apart(hypotheses, T, target, HYPOTHESES),
        correlated(source, target, T, radius))), WIDE, 0, FEW // 2)
    if len(weak):
        others = along_ridges(source, target, T, others, weak, radius)
    others = others[_keeps_level(source, target, others)]
    few = testify(source, target, np.concatenate((T[None], others)), FEW)
    rivals = others[~ruled_out(few[0], few[1:])]
    fitted = np.concatenate((T[None], icp(source, target, pushed(T, pushes), WIDE, NARROW),
                             icp(source, target, rivals, 0, NARROW)))
    many = testify(source, target, fitted, MANY)
    best = winner(many)
    if best > 0 and again:
        return contest(source, target, fitted[best], hypotheses, radius, again=False)
    standing = differ(fitted[best], fitted, target) & ~ruled_out(many[best], many)
    late = standing.copy()
    late[:1 + len(pushes)] = False
    if late.any():
        # some are only on their way to the answer
        fitted[late] = icp(source, target, fitted[late], LATE, LATE)
        many[late] = testify(source, target, fitted[late], MANY)
        standing = differ(fitted[best], fitted, target) & ~ruled_out(many[best], many)
    slides = tuple(
        _measured(source, target, fitted[best], many[best], twist, lever, radius)
        for k, twist in enumerate(weak)
        if _slides(fitted[[0, 1 + k, 1 + k + len(weak)]], standing[[1 + k, 1 + k + len(weak)]],
                   pushes[k]))
    standing[1:1 + len(pushes)] = False    # these were asked for the slides
    return _remaining(fitted, many, best, standing, slides, len(weak) > 0, target)


def _keeps_level(source: View, target: View, placements: NDArray[np.float64]
                 ) -> NDArray[np.bool_]:
    """Return which of (K, 4, 4) placements keep the ground level, as far as it is known, (K,)."""
    if not (source.level and target.level):
        return np.ones(len(placements), np.bool_)
    level: NDArray[np.bool_] = (placements[:, :3, :3] @ source.axes[2]) @ target.axes[2] > LEVEL
    return level


def _slides(placements: NDArray[np.float64], standing: NDArray[np.bool_],
            push: NDArray[np.float64]) -> bool:
    """Return whether a placement that was pushed both ways, (3, 4, 4), stays where it came to."""
    if is_shift(push / np.linalg.norm(push)):
        came = np.linalg.norm(placements[1:, :3, 3] - placements[0, :3, 3], axis=1)
        wanted = np.linalg.norm(push[:3])
    else:
        came = np.linalg.norm(se3.rotation_vectors(
            placements[1:, :3, :3] @ placements[0, :3, :3].T), axis=1)
        wanted = np.linalg.norm(push[3:])
    return bool(standing.any() and came.mean() > STAYS * wanted)


def _measured(source: View, target: View, T: NDArray[np.float64], outcomes: NDArray[np.int8],
              twist: NDArray[np.float64], lever: float, radius: float) -> Slide:
    """Find out how far, and where to, the clouds can be pushed along a free direction."""
    ways = target.reach * np.array([way for length in PUSHES for way in (length, -length)])
    tried = icp(source, target, pushed(T, np.outer(ways, twist)), WIDE, NARROW)
    said = testify(source, target, tried, MANY)
    standing = differ(T, tried, target) & ~ruled_out(outcomes, said)
    if not standing[:2].any():
        return Slide(twist, PUSHES[0] * target.reach, lever)
    if is_shift(twist):
        # the line through the places where it stands is straighter than the eigenvector
        places = np.vstack((T[:3, 3], tried[standing, :3, 3]))
        line = np.linalg.svd(places - places.mean(axis=0))[2][0]
        if target.level:
            # nor does it leave the ground, of which the keypoints are none
            line -= (line @ target.axes[2]) * target.axes[2]
        twist = np.concatenate((line / np.linalg.norm(line), np.zeros(3)))
    # with no end in sight the source may be anywhere around the target, wherever it is laid now
    offset = float(T[:3, 3] @ twist[:3])
    return Slide(twist, float(np.hypot(radius / np.sqrt(3), offset)), lever)


def _remaining(placements: NDArray[np.float64], outcomes: NDArray[np.int8], best: int,
               standing: NDArray[np.bool_], slides: tuple[Slide, ...], weak: bool, target: View
               ) -> Contest:
    """Keep of the rivals that stand those that are really others, the best first."""
    T = placements[best]
    rows = np.flatnonzero(standing)
    against, back = exclusive(outcomes[best], outcomes[rows])
    support = (outcomes[rows] == AGREE).mean(axis=1)
    kept: list[int] = []
    for row in rows[np.argsort(against - back - support, kind='stable')]:
        slid = [without_slides(placements[row], placements[other], slides)
                for other in (best, *kept)]
        if differ(placements[row], np.array(slid), target).all():
            kept.append(int(row))
    return Contest(T, outcomes[best], placements[kept], outcomes[kept], slides, weak)
