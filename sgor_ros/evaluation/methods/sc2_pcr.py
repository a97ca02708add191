"""SC2-PCR (Chen et al., CVPR 2022), the solver nearest to SGOR, from the paper.

Its parameters are those of the authors' configurations for KITTI and 3DMatch, which differ in the
inlier threshold, the suppression radius, the power iterations and the refinement only.
"""
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from ...core.solver.hypotheses import fit_transforms
from .compatibility import leading_eigenvector
from .compatibility import length_differences
from .compatibility import with_values
from .consensus import best
from .consensus import refined
from .interface import Answer
from .interface import INDOOR_M
from .interface import Matches

Array = NDArray[np.float64]

LENGTH_LIMIT_M = 0.1
SEED_SHARE = 0.2
FIRST, SECOND = 30, 20
"""k_1 and k_2: matches in the two stages of a consensus set."""
ROUNDS_OUTDOOR, ROUNDS_INDOOR = 20, 10
REFINED_OUTDOOR_M = 1.2
SEEDS_AT_ONCE = 256


def sc2_pcr(matches: Matches) -> Answer:
    """Consensus sets by second-order spatial compatibility, grown from seeds; the best wins."""
    n = len(matches.source)
    indoor = matches.inlier_m <= INDOOR_M
    rounds = ROUNDS_INDOOR if indoor else ROUNDS_OUTDOOR
    if n < SECOND:
        return Answer(None)
    c = length_differences(matches.source, matches.target, LENGTH_LIMIT_M)
    soft = with_values(c, 1 - (c.data / LENGTH_LIMIT_M)**2)
    hard = with_values(c, np.ones_like(c.data))
    tight = with_values(c, (c.data < LENGTH_LIMIT_M / 2).astype(np.float64))
    seeds = _seeds(matches.source, leading_eigenvector(soft, rounds), matches.inlier_m)
    T = np.concatenate([_hypotheses(matches, some, hard, tight, rounds) for some in
                        np.array_split(seeds, -(-len(seeds) // SEEDS_AT_ONCE))])
    chosen = best(matches, T, lambda r: float(np.count_nonzero(r < matches.inlier_m)))
    return Answer(refined(matches, chosen, matches.inlier_m if indoor else REFINED_OUTDOOR_M))


def _seeds(source: Array, confidence: Array, radius: float) -> NDArray[np.intp]:
    """Return a share of the matches: local maxima of the confidence first, the others after."""
    i, j = cKDTree(source).query_pairs(radius, output_type='ndarray').T
    highest = np.ones(len(source), np.bool_)
    highest[i[confidence[i] < confidence[j]]] = False
    highest[j[confidence[j] < confidence[i]]] = False
    order = np.argsort(-confidence * highest, kind='stable')
    return order[:max(int(SEED_SHARE * len(source)), 1)]


def _hypotheses(matches: Matches, seeds: NDArray[np.intp], hard: csr_array, tight: csr_array,
                rounds: int) -> Array:
    """Fit one transformation to the consensus set of each seed, (S, 4, 4)."""
    second_order = ((tight[seeds] @ tight) * hard[seeds]).toarray()
    sets = _largest(second_order, min(FIRST, second_order.shape[1]))
    # within each set, by how much its members and the seed, the first, support each other
    within = (_differences(matches, sets) < LENGTH_LIMIT_M).astype(np.float64)
    support = np.einsum('sj,sjk->sk', within[:, 0], within)
    sets = np.take_along_axis(sets, _largest(support, SECOND), axis=1)
    weights = np.maximum(0, 1 - (_differences(matches, sets) / LENGTH_LIMIT_M)**2)
    weights[:, np.arange(SECOND), np.arange(SECOND)] = 0
    vector = np.ones((len(sets), SECOND))
    for _ in range(rounds):
        vector = np.einsum('sjk,sk->sj', weights, vector)
        vector /= np.linalg.norm(vector, axis=1, keepdims=True) + 1e-6
    # where nothing supports anything there is no fit: an even one will lose
    vector[vector.sum(axis=1) < 1e-6] = 1
    return fit_transforms(matches.source[sets], matches.target[sets], vector)


def _largest(values: Array, count: int) -> NDArray[np.intp]:
    """Return the columns of the `count` largest of each row, the largest first."""
    return np.argsort(-values, axis=1, kind='stable')[:, :count]


def _differences(matches: Matches, sets: NDArray[np.intp]) -> Array:
    """Return c_ij of the matches within each of (S, k) sets, (S, k, k)."""
    def lengths(points: Array) -> Array:
        chosen = points[sets]
        between: Array = np.linalg.norm(chosen[:, :, None] - chosen[:, None], axis=3)
        return between

    difference: Array = np.abs(lengths(matches.source) - lengths(matches.target))
    return difference
