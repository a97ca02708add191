"""Two placements compared: whether they differ, and which of them free space rules out."""
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from .evidence import AGREE
from .evidence import CONTRADICT
from .view import View

LEAST_SUPPORT = 0.45
"""A rival with less of the agreement of the answer explains too little to be one."""
CLEAR_COUNT, CLEAR_SHARE, CLEAR_RATIO = 5, 0.003, 3.0
"""A rival is out when its violations outnumber those of the answer by this count, by this share of
the points asked, and so many times."""
SAME_ANGLE = np.radians(5.0)
"""With the reach, the least difference of two placements."""


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
    against, back = exclusive(answer, rivals)
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
    turned = se3.rotation_vectors(others[:, :3, :3] @ T[:3, :3].T)
    shifted = others[:, :3, 3] - T[:3, 3]
    if target.level:
        turned, shifted = turned @ target.axes[2:].T, shifted @ target.axes[:2].T
    different: NDArray[np.bool_] = np.linalg.norm(shifted, axis=1) > reaches * target.reach
    different |= np.linalg.norm(turned, axis=1) > SAME_ANGLE
    return different


def exclusive(answer: NDArray[np.int8], rivals: NDArray[np.int8]
              ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Count what the answer explains and each rival violates, and the other way round, (K,)."""
    against = ((answer == AGREE) & (rivals == CONTRADICT)).sum(axis=1)
    back = ((answer == CONTRADICT) & (rivals == AGREE)).sum(axis=1)
    return against, back


def winner(outcomes: NDArray[np.int8]) -> int:
    """Return the row that no other row beats, beginning with the first."""
    best = 0
    support = (outcomes == AGREE).sum(axis=1)
    for _ in range(len(outcomes)):
        against, back = exclusive(outcomes[best], outcomes)
        lead = back - against
        # one that is hardly anywhere violates nothing either
        lead[(support < LEAST_SUPPORT * support[best]) | (back < CLEAR_RATIO * against)] = 0
        challenger = int(np.argmax(lead))
        if lead[challenger] < max(CLEAR_COUNT, CLEAR_SHARE * outcomes.shape[1]):
            break
        best = challenger
    return best


def apart(candidates: NDArray[np.float64], T: NDArray[np.float64], target: View, most: int
           ) -> NDArray[np.float64]:
    """Return the first of (H, 4, 4) that differ from T and from each other."""
    left = candidates[differ(T, candidates, target)]
    kept: list[NDArray[np.float64]] = []
    while len(left) and len(kept) < most:
        kept.append(left[0])
        left = left[differ(left[0], left, target)]
    return np.array(kept).reshape(-1, 4, 4)
