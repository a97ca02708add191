"""Rivals: the other placements of the source that the clouds may not rule out (beyond the paper).

Where places repeat (perceptual aliasing) a wrong transformation explains the clouds as well as the
right one, and no evidence for one of them alone can tell. So others are looked for far away: where
the label maps of both scans, seen from above, correlate for some shift and quarter turn, and among
the hypotheses of the solver. Each is fitted by ICP and asked the same questions.

A rival is ruled out by free space: where it lays points into what the other sensor has looked
through, and the answer does not. What every placement explains, walls and road, says nothing.
"""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..common import se3
from .degeneracy import is_shift
from .degeneracy import PUSH
from .degeneracy import pushed
from .degeneracy import PUSHES
from .degeneracy import Slide
from .degeneracy import weak_directions
from .degeneracy import without_slides
from .evidence import AGREE
from .evidence import CONTRADICT
from .evidence import SEVERITY
from .evidence import spread
from .evidence import testify
from .icp import icp
from .view import kinds_of
from .view import map_bits
from .view import sectors_of
from .view import View

TURNS = 4
"""Quarter turns: what people build repeats itself under these."""
SWEEP_SAMPLE, PEAKS = 200, 4
"""Keypoints that are swept over the overhead map, and placements that come of each turn."""
HYPOTHESES = 6
"""Placements taken from the hypotheses of the solver."""
WIDE, NARROW = 3, 4
"""Rounds of ICP for each rival."""
LATE = 10
"""Rounds of either kind for the few that nothing has ruled out by then."""
LEAST_SUPPORT = 0.45
"""A rival with less of the agreement of the answer explains too little to be one."""
FEW, MANY = 250, 1000
"""Keypoints of each scan asked first, and where that does not rule a rival out."""
CLEAR_COUNT, CLEAR_SHARE, CLEAR_RATIO = 5, 0.003, 3.0
"""A rival is out when its violations outnumber those of the answer by this count, by this share of
the points asked, and so many times."""
RIDGE_PEAKS = 8
"""Placements taken of each ridge: of all steps of one reach along a weak direction."""
TUNING = (-0.5, -0.25, 0.25, 0.5)
"""Finer steps along a weak direction, in reaches of the views."""
STAYS = 0.8
"""A direction is free where a push along it is kept to this share: elsewhere the clouds slide
back."""
LEVEL = np.cos(np.radians(10.0))
"""Least cosine of the ground normals under a rival: slopes and their estimates included."""
SAME_ANGLE = np.radians(5.0)
"""With the reach, the least difference of two placements."""


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
    """

    T_target_source: NDArray[np.float64]
    outcomes: NDArray[np.int8]
    rivals: NDArray[np.float64]
    rival_outcomes: NDArray[np.int8]
    slides: tuple[Slide, ...] = ()


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
        _apart(hypotheses, T, target, HYPOTHESES),
        correlated(source, target, T, radius))), WIDE, 0, FEW // 2)
    if len(weak):
        others = _along_ridges(source, target, T, others, weak, radius)
    others = others[_keeps_level(source, target, others)]
    few = testify(source, target, np.concatenate((T[None], others)), FEW)
    rivals = others[~ruled_out(few[0], few[1:])]
    fitted = np.concatenate((T[None], icp(source, target, pushed(T, pushes), WIDE, NARROW),
                             icp(source, target, rivals, 0, NARROW)))
    many = testify(source, target, fitted, MANY)
    best = _winner(many)
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
    return _remaining(fitted, many, best, standing, slides, target)


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
        came = Rotation.from_matrix(placements[1:, :3, :3] @ placements[0, :3, :3].T).magnitude()
        wanted = np.linalg.norm(push[3:])
    return bool(standing.any() and came.mean() > STAYS * wanted)


def _along_ridges(source: View, target: View, T: NDArray[np.float64],
                  others: NDArray[np.float64], weak: NDArray[np.float64], radius: float
                  ) -> NDArray[np.float64]:
    """Look along the weak directions, where ICP hardly pulls: (P, 4, 4) in place of the others.

    From the placement and from the best of the others for each turn, step by step.
    """
    few = testify(source, target, np.concatenate((T[None], others)), FEW)
    support = (few == AGREE).sum(axis=1)
    rows = np.flatnonzero(support >= LEAST_SUPPORT * support[0])
    placements = np.concatenate((T[None], others))[rows]
    turned = Rotation.from_matrix(placements[:, :3, :3] @ T[:3, :3].T).magnitude()
    quarters = np.round(turned / (np.pi / 2))
    seeds = [placements[quarters == quarter][np.argmax(support[rows][quarters == quarter])]
             for quarter in np.unique(quarters)]
    way = np.arange(-radius, radius + target.reach, target.reach)
    ridges = [placements[1:]]
    for seed in seeds:
        for twist in weak:
            steps = pushed(seed, np.outer(way, twist))
            score = _score(testify(source, target, steps, FEW))
            ridges.append(steps[_ridge_peaks(score, RIDGE_PEAKS)])
    found = _tuned(source, target, np.concatenate(ridges), weak)
    far = np.linalg.norm(found[:, :3, 3] - T[:3, 3], axis=1)
    # nearer to the answer, the pushes decide
    return found[differ(T, found, target, PUSH) & (far < radius)]


def _score(outcomes: NDArray[np.int8]) -> NDArray[np.float64]:
    """Return what speaks for each row of (K, n) outcomes, (K,)."""
    score: NDArray[np.float64] = ((outcomes == AGREE).sum(axis=1)
                                  - SEVERITY * (outcomes == CONTRADICT).sum(axis=1))
    return score


def _ridge_peaks(score: NDArray[np.float64], most: int) -> list[int]:
    """Return the steps with the highest scores, none next to a higher one."""
    left = score.copy()
    peaks: list[int] = []
    while len(peaks) < most and left.max() > 0:
        at = int(np.argmax(left))
        peaks.append(at)
        left[max(0, at - 1):at + 2] = -np.inf
    return peaks


def _tuned(source: View, target: View, placements: NDArray[np.float64],
           weak: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move (K, 4, 4) rivals along the weak directions to their best."""
    steps = target.reach * np.vstack([np.zeros((1, 6)), *(step * weak for step in TUNING)])
    tried = np.array([pushed(T, steps) for T in placements])
    said = testify(source, target, tried.reshape(-1, 4, 4), FEW)
    best = np.argmax(_score(said).reshape(tried.shape[:2]), axis=1)
    return tried[np.arange(len(placements)), best]


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
    # with no end in sight, anywhere within the radius is as likely
    return Slide(twist, radius / np.sqrt(3), lever)


def ruled_out(answer: NDArray[np.int8], rivals: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Return which rivals the clouds rule out beside the answer, (K,).

    Parameters
    ----------
    answer : (n,) int8
        Outcomes of the answer, see `evidence.testify`.
    rivals : (K, n) int8
        Outcomes of the rivals at the same points.
    """
    support = (rivals == AGREE).sum(axis=1)
    against, back = _exclusive(answer, rivals)
    out: NDArray[np.bool_] = against - back >= max(CLEAR_COUNT, CLEAR_SHARE * len(answer))
    out &= against >= CLEAR_RATIO * back
    out |= support < LEAST_SUPPORT * (answer == AGREE).sum()
    return out


def differ(T: NDArray[np.float64], others: NDArray[np.float64], target: View,
           reaches: float = 1.0) -> NDArray[np.bool_]:
    """Return which of (K, 4, 4) placements lie more than some reaches from T, or turned, (K,).

    On level ground only shifts and turns in its plane count: the ground holds the rest, and the
    keypoints are none of it.
    """
    turned: NDArray[np.float64] = Rotation.from_matrix(
        others[:, :3, :3] @ T[:3, :3].T).as_rotvec()
    shifted = others[:, :3, 3] - T[:3, 3]
    if target.level:
        turned, shifted = turned @ target.axes[2:].T, shifted @ target.axes[:2].T
    apart: NDArray[np.bool_] = np.linalg.norm(shifted, axis=1) > reaches * target.reach
    apart |= np.linalg.norm(turned, axis=1) > SAME_ANGLE
    return apart


def correlated(source: View, target: View, T_target_source: NDArray[np.float64], radius: float
               ) -> NDArray[np.float64]:
    """Return where the overhead maps agree best, moved and turned from a placement: (P, 4, 4).

    Parameters
    ----------
    radius : float
        Farthest shift of the source's sensor along either axis of the ground plane, metres.
    """
    rows = spread(len(source.points), SWEEP_SAMPLE)
    placed = se3.transform(T_target_source, source.points[rows]) @ target.axes.T
    sensor = target.axes @ T_target_source[:3, 3]
    facing = source.normals[rows] @ (target.axes @ T_target_source[:3, :3]).T
    overhead = target.overhead
    kinds = kinds_of(source.labels[rows], placed[:, 2], overhead.edge)
    turned, bits = np.empty((TURNS, len(rows), 2)), np.empty((TURNS, len(rows)), np.uint64)
    for turn in range(TURNS):
        about = _quarter(turn)
        turned[turn] = (placed[:, :2] - sensor[:2]) @ about[:2, :2].T + sensor[:2]
        bits[turn] = map_bits(kinds, sectors_of(facing @ about.T))
    columns = np.floor((turned - overhead.low) / overhead.edge).astype(np.int64)
    # a keypoint marks the cells around its own: every second shift is enough
    half = int(radius / (2 * overhead.edge))
    hits = np.zeros((TURNS, 2 * half + 1, 2 * half + 1), np.int32)
    # even and odd columns apart, so that every second cell is the next one in memory
    _sweep(columns, bits, np.stack((overhead.cells[:, ::2], overhead.cells[:, 1::2])), half, hits)
    # the placement itself is no rival
    hits[0, half - 1:half + 2, half - 1:half + 2] = 0
    peaks = _peaks(hits, PEAKS)
    found = np.empty((len(peaks), 4, 4))
    for k, (turn, i, j) in enumerate(peaks):
        about = _quarter(turn)
        shift = 2 * overhead.edge * np.array([i - half, j - half, 0])
        move = se3.compose(target.axes.T @ about @ target.axes,
                           target.axes.T @ (sensor - about @ sensor + shift))
        found[k] = move @ T_target_source
    return found


def _quarter(turn: int) -> NDArray[np.float64]:
    """Return the rotation by quarter turns about the third axis."""
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn]
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]], np.float64)


def _exclusive(answer: NDArray[np.int8], rivals: NDArray[np.int8]
               ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Count what the answer explains and each rival violates, and the other way round, (K,)."""
    against = ((answer == AGREE) & (rivals == CONTRADICT)).sum(axis=1)
    back = ((answer == CONTRADICT) & (rivals == AGREE)).sum(axis=1)
    return against, back


def _winner(outcomes: NDArray[np.int8]) -> int:
    """Return the row that no other row beats, beginning with the first."""
    best = 0
    support = (outcomes == AGREE).sum(axis=1)
    for _ in range(len(outcomes)):
        against, back = _exclusive(outcomes[best], outcomes)
        lead = back - against
        # one that is hardly anywhere violates nothing either
        lead[(support < LEAST_SUPPORT * support[best]) | (back < CLEAR_RATIO * against)] = 0
        challenger = int(np.argmax(lead))
        if lead[challenger] < max(CLEAR_COUNT, CLEAR_SHARE * outcomes.shape[1]):
            break
        best = challenger
    return best


def _remaining(placements: NDArray[np.float64], outcomes: NDArray[np.int8], best: int,
               standing: NDArray[np.bool_], slides: tuple[Slide, ...], target: View) -> Contest:
    """Keep of the rivals that stand those that are really others, the best first."""
    T = placements[best]
    rows = np.flatnonzero(standing)
    against, back = _exclusive(outcomes[best], outcomes[rows])
    support = (outcomes[rows] == AGREE).mean(axis=1)
    kept: list[int] = []
    for row in rows[np.argsort(against - back - support, kind='stable')]:
        slid = [without_slides(placements[row], placements[other], slides)
                for other in (best, *kept)]
        if differ(placements[row], np.array(slid), target).all():
            kept.append(int(row))
    return Contest(T, outcomes[best], placements[kept], outcomes[kept], slides)


def _apart(candidates: NDArray[np.float64], T: NDArray[np.float64], target: View, most: int
           ) -> NDArray[np.float64]:
    """Return the first of (H, 4, 4) that differ from T and from each other."""
    left = candidates[differ(T, candidates, target)]
    kept: list[NDArray[np.float64]] = []
    while len(left) and len(kept) < most:
        kept.append(left[0])
        left = left[differ(left[0], left, target)]
    return np.array(kept).reshape(-1, 4, 4)


@numba.njit(cache=True, nogil=True, parallel=True)
def _sweep(columns, bits, cells, half, hits):  # type: ignore[no-untyped-def]
    """Count for each turn and shift, by two cells each, the points whose bit is in their cell."""
    size, width = cells.shape[1], 2 * half + 1
    for task in numba.prange(len(columns) * width):
        turn = np.int64(task) // width
        i = np.int64(task) % width
        row = hits[turn, i]
        for k in range(columns.shape[1]):
            x = columns[turn, k, 0] + 2 * (i - half)
            if x < 0 or x >= size:
                continue
            # y // 2 and the shifts that stay on the map
            at = (columns[turn, k, 1] >> 1) - half
            first, last = max(0, -at), min(width, cells.shape[2] - at)
            if first >= last:
                continue
            run = cells[columns[turn, k, 1] & 1, x, at + first:at + last]
            bit = bits[turn, k]
            for j in range(len(run)):
                row[first + j] += np.int32((run[j] & bit) != 0)


@numba.njit(cache=True, nogil=True)
def _peaks(hits, most):  # type: ignore[no-untyped-def]
    """Return the `most` highest (turn, i, j) of each turn, none next to a higher; spoils hits."""
    peaks = np.empty((len(hits) * most, 3), np.int64)
    count = 0
    for turn in range(len(hits)):
        for _ in range(most):
            at = np.argmax(hits[turn])
            i, j = at // hits.shape[2], at % hits.shape[2]
            if hits[turn, i, j] == 0:
                break
            peaks[count] = (turn, i, j)
            count += 1
            hits[turn, max(0, i - 1):i + 2, max(0, j - 1):j + 2] = 0
    return peaks[:count]
