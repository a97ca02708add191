"""What the relatives do with their hypotheses: count, choose, refine."""
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...core.solver.hypotheses import fit_transforms
from .interface import Matches

Array = NDArray[np.float64]

REFINEMENTS = 20


def residuals(matches: Matches, T_target_source: Array) -> Array:
    """Return the distance of each match under a transformation, (N,), metres."""
    distance: Array = np.linalg.norm(
        se3.transform(T_target_source, matches.source) - matches.target, axis=1)
    return distance


def best(matches: Matches, T_target_source: Array, score: Callable[[Array], float]) -> Array:
    """Return the one of (H, 4, 4) whose residuals score highest, the first of equals."""
    scores = [score(residuals(matches, T)) for T in T_target_source]
    chosen: Array = T_target_source[int(np.argmax(scores))]
    return chosen


def refined(matches: Matches, T_target_source: Array, limit: float) -> Array:
    """Refit to the matches below `limit`, weighted, until their number stays."""
    before = 0
    for _ in range(REFINEMENTS):
        distance = residuals(matches, T_target_source)
        near = distance < limit
        count = int(np.count_nonzero(near))
        if count == before or count < 3:
            break
        before = count
        T_target_source, = fit_transforms(
            matches.source[near][None], matches.target[near][None],
            1 / (1 + (distance[near] / limit)**2)[None])
    return T_target_source
