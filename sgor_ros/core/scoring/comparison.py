"""Poses compared: whether they differ, and which of them free space rules out."""
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..index.scan_index import ScanIndex
from .pose_scoring import AGREES
from .pose_scoring import VIOLATES

LEAST_SUPPORT = 0.45
"""A pose with less of the overlap of the answer explains too little to compete with it."""
CLEAR_COUNT, CLEAR_SHARE, CLEAR_RATIO = 5, 0.003, 3.0
"""A pose is ruled out when its violations outnumber those of the answer by this count, by this
share of the keypoints asked, and so many times."""
CLEAR_NOISE = 0.5
"""And by so many times those of the answer: even the right pose has some, of the same noise."""
TOO_MANY = 0.0125
"""A pose is ruled out, too, when its violations outnumber `CLEAR_RATIO` times those of the answer
by this share of the keypoints asked, wherever they are."""
SAME_ANGLE = np.radians(5.0)
"""With the maximum correspondence distance, the least difference of two poses."""


def ruled_out(answer: NDArray[np.int8], others: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Return which other poses the clouds rule out beside the answer, (K,).

    Parameters
    ----------
    answer : (n,) int8
        Outcomes of the answer, see `score_keypoints`.
    others : (K, n) int8
        Outcomes of the others at the same keypoints.
    """
    support = (others == AGREES).sum(axis=1)
    against, back = exclusive_violations(answer, others)
    own, theirs = int((answer == VIOLATES).sum()), (others == VIOLATES).sum(axis=1)
    clear = max(CLEAR_COUNT, CLEAR_SHARE * len(answer)) + CLEAR_NOISE * own
    out: NDArray[np.bool_] = against - back >= clear
    out &= against >= CLEAR_RATIO * back
    out |= theirs - CLEAR_RATIO * own >= TOO_MANY * len(answer)
    out |= support < LEAST_SUPPORT * (answer == AGREES).sum()
    return out


def differ(T: NDArray[np.float64], others: NDArray[np.float64], target: ScanIndex,
           distances: float = 1.0) -> NDArray[np.bool_]:
    """Return which of (K, 4, 4) poses lie some maximum distances away from T, or turned, (K,).

    On level ground only shifts and turns in its plane count: the ground holds the rest, and the
    keypoints are none of it.
    """
    turned = se3.rotation_vectors(others[:, :3, :3] @ T[:3, :3].T)
    shifted = others[:, :3, 3] - T[:3, 3]
    if target.level:
        turned, shifted = turned @ target.axes[2:].T, shifted @ target.axes[:2].T
    different: NDArray[np.bool_] = (np.linalg.norm(shifted, axis=1)
                                    > distances * target.max_distance)
    different |= np.linalg.norm(turned, axis=1) > SAME_ANGLE
    return different


def exclusive_violations(answer: NDArray[np.int8], others: NDArray[np.int8]
                         ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Count what the answer explains and each other violates, and the other way round, (K,)."""
    against = ((answer == AGREES) & (others == VIOLATES)).sum(axis=1)
    back = ((answer == VIOLATES) & (others == AGREES)).sum(axis=1)
    return against, back


def best_supported(outcomes: NDArray[np.int8]) -> int:
    """Return the row that no other row beats, beginning with the first.

    One beats another by exclusive violations, or by so much more support that beside it the other
    explains too little.
    """
    best = 0
    support = (outcomes == AGREES).sum(axis=1)
    for _ in range(len(outcomes)):
        against, back = exclusive_violations(outcomes[best], outcomes)
        lead = back - against
        # one that is hardly anywhere violates nothing either
        lead[(support < LEAST_SUPPORT * support[best]) | (back < CLEAR_RATIO * against)] = 0
        challenger = int(np.argmax(lead))
        if lead[challenger] < max(CLEAR_COUNT, CLEAR_SHARE * outcomes.shape[1]):
            # or else the best supported one
            standing = np.where(ruled_out(outcomes[best], outcomes), 0, support)
            challenger = int(np.argmax(standing))
            if support[best] >= LEAST_SUPPORT * standing[challenger]:
                break
        best = challenger
    return best


def apart(candidates: NDArray[np.float64], T: NDArray[np.float64], target: ScanIndex, most: int
           ) -> NDArray[np.float64]:
    """Return the first of (H, 4, 4) that differ from T and from each other."""
    left = candidates[differ(T, candidates, target)]
    kept: list[NDArray[np.float64]] = []
    while len(left) and len(kept) < most:
        kept.append(left[0])
        left = left[differ(left[0], left, target)]
    return np.array(kept).reshape(-1, 4, 4)
