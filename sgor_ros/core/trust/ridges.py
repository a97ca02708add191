"""Rivals along weak directions, where ICP hardly pulls: looked for step by step."""
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from .comparison import differ
from .comparison import LEAST_SUPPORT
from .degeneracy import PUSH
from .degeneracy import pushed
from .evidence import AGREE
from .evidence import CONTRADICT
from .evidence import SEVERITY
from .evidence import testify
from .view import View

RIDGE_PEAKS = 8
"""Placements taken of each ridge: of all steps of one reach along a weak direction."""
TUNING = (-0.5, -0.25, 0.25, 0.5)
"""Finer steps along a weak direction, in reaches of the views."""
SAMPLE = 250
"""Keypoints of each scan asked about a step."""


def along_ridges(source: View, target: View, T: NDArray[np.float64],
                 others: NDArray[np.float64], weak: NDArray[np.float64], radius: float
                 ) -> NDArray[np.float64]:
    """Look along the weak directions, where ICP hardly pulls: (P, 4, 4) in place of the others.

    From the placement and from the best of the others for each turn, step by step.
    """
    few = testify(source, target, np.concatenate((T[None], others)), SAMPLE)
    support = (few == AGREE).sum(axis=1)
    rows = np.flatnonzero(support >= LEAST_SUPPORT * support[0])
    placements = np.concatenate((T[None], others))[rows]
    turned = np.linalg.norm(se3.rotation_vectors(placements[:, :3, :3] @ T[:3, :3].T), axis=1)
    quarters = np.round(turned / (np.pi / 2))
    seeds = [placements[quarters == quarter][np.argmax(support[rows][quarters == quarter])]
             for quarter in np.unique(quarters)]
    way = np.arange(-radius, radius + target.reach, target.reach)
    ridges = [placements[1:]]
    for seed in seeds:
        for twist in weak:
            steps = pushed(seed, np.outer(way, twist))
            score = _score(testify(source, target, steps, SAMPLE))
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
    if not len(placements):
        return placements
    steps = target.reach * np.vstack([np.zeros((1, 6)), *(step * weak for step in TUNING)])
    tried = np.array([pushed(T, steps) for T in placements])
    said = testify(source, target, tried.reshape(-1, 4, 4), SAMPLE)
    best = np.argmax(_score(said).reshape(tried.shape[:2]), axis=1)
    return tried[np.arange(len(placements)), best]
