"""Competing poses along weak directions, where ICP hardly pulls: looked for step by step."""
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..degeneracy.directions import perturbed_poses
from ..degeneracy.perturbation_test import PUSH
from ..index.scan_index import ScanIndex
from ..scoring.comparison import differ
from ..scoring.comparison import LEAST_SUPPORT
from ..scoring.pose_scoring import AGREES
from ..scoring.pose_scoring import score_keypoints
from ..scoring.pose_scoring import VIOLATES
from ..scoring.pose_scoring import VIOLATION_WEIGHT

PEAKS = 8
"""Poses taken of all steps along a weak direction, each of one maximum distance."""
TUNING = (-0.5, -0.25, 0.25, 0.5)
"""Finer steps along a weak direction, in maximum correspondence distances."""
KEYPOINTS = 250
"""Keypoints of each scan asked about a step."""


def search_weak_directions(source: ScanIndex, target: ScanIndex, T: NDArray[np.float64],
                           others: NDArray[np.float64], weak: NDArray[np.float64], radius: float
                           ) -> NDArray[np.float64]:
    """Look along the weak directions, where ICP hardly pulls: (P, 4, 4) in place of the others.

    From the pose and from the best of the others for each turn, step by step.
    """
    few = score_keypoints(source, target, np.concatenate((T[None], others)), KEYPOINTS)
    support = (few == AGREES).sum(axis=1)
    rows = np.flatnonzero(support >= LEAST_SUPPORT * support[0])
    poses = np.concatenate((T[None], others))[rows]
    turned = np.linalg.norm(se3.rotation_vectors(poses[:, :3, :3] @ T[:3, :3].T), axis=1)
    quarters = np.round(turned / (np.pi / 2))
    seeds = [poses[quarters == quarter][np.argmax(support[rows][quarters == quarter])]
             for quarter in np.unique(quarters)]
    way = np.arange(-radius, radius + target.max_distance, target.max_distance)
    lines = [poses[1:]]
    for seed in seeds:
        for twist in weak:
            steps = perturbed_poses(seed, np.outer(way, twist))
            score = _score(score_keypoints(source, target, steps, KEYPOINTS))
            lines.append(steps[_peaks(score, PEAKS)])
    found = _tuned(source, target, np.concatenate(lines), weak)
    far = np.linalg.norm(found[:, :3, 3] - T[:3, 3], axis=1)
    # nearer to the answer, the pushes decide
    return found[differ(T, found, target, PUSH) & (far < radius)]


def _score(outcomes: NDArray[np.int8]) -> NDArray[np.float64]:
    """Return agreements less weighted violations of each row of (K, n) outcomes, (K,)."""
    score: NDArray[np.float64] = ((outcomes == AGREES).sum(axis=1)
                                  - VIOLATION_WEIGHT * (outcomes == VIOLATES).sum(axis=1))
    return score


def _peaks(score: NDArray[np.float64], most: int) -> list[int]:
    """Return the steps with the highest scores, none next to a higher one."""
    left = score.copy()
    peaks: list[int] = []
    while len(peaks) < most and left.max() > 0:
        at = int(np.argmax(left))
        peaks.append(at)
        left[max(0, at - 1):at + 2] = -np.inf
    return peaks


def _tuned(source: ScanIndex, target: ScanIndex, poses: NDArray[np.float64],
           weak: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move (K, 4, 4) poses along the weak directions to their best."""
    if not len(poses):
        return poses
    steps = target.max_distance * np.vstack([np.zeros((1, 6)), *(step * weak for step in TUNING)])
    tried = np.array([perturbed_poses(T, steps) for T in poses])
    outcomes = score_keypoints(source, target, tried.reshape(-1, 4, 4), KEYPOINTS)
    best = np.argmax(_score(outcomes).reshape(tried.shape[:2]), axis=1)
    return tried[np.arange(len(poses)), best]
