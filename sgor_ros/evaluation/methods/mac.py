"""MAC: maximal cliques of a compatibility graph (Zhang et al., CVPR 2023), from the paper.

The cliques are found by igraph. Of all maximal cliques those stay that are the heaviest of one of
their members (node-guided clique selection). Where the graph is so dense that its cliques cannot
be listed, it is thinned.
"""
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse import triu

from ...core.solver.hypotheses import fit_transforms
from .compatibility import length_differences
from .compatibility import with_values
from .compatibility import without_diagonal
from .consensus import best
from .consensus import refined
from .interface import Answer
from .interface import INDOOR_M
from .interface import Matches

Array = NDArray[np.float64]

LEAST_OUTDOOR, LEAST_INDOOR = 0.9, 0.99
"""Edges need this compatibility, 1 - c^2 / inlier_m^2."""
MOST_CORE, THINNING = 64, 0.5
"""Where nodes have more neighbours than so many that have as many, there may be more cliques than
can be listed: this share of the edges stays, the strongest."""


def mac(matches: Matches) -> Answer:
    """Fit to each clique that is the heaviest of a match, and take the best."""
    least = LEAST_INDOOR if matches.inlier_m <= INDOOR_M else LEAST_OUTDOOR
    limit = matches.inlier_m * np.sqrt(1 - least)
    c = without_zeros(length_differences(matches.source, matches.target, limit))
    first = without_diagonal(with_values(c, 1 - (c.data / matches.inlier_m)**2))
    second = (first @ first) * first
    cliques = _selected(csr_array(second))
    if not cliques:
        return Answer(None)
    T = np.concatenate([
        fit_transforms(matches.source[sets], matches.target[sets], np.ones(sets.shape))
        for sets in cliques])

    def score(r: Array) -> float:
        return float(np.maximum(0, 1 - r / matches.inlier_m).sum())

    return Answer(refined(matches, best(matches, T, score), matches.inlier_m))


def without_zeros(c: csr_array) -> csr_array:
    """Return the matrix with its zeros, which are perfect fits, kept as something tiny."""
    return with_values(c, np.maximum(c.data, 1e-12))


def _selected(weights: csr_array) -> list[NDArray[np.intp]]:
    """Return the maximal cliques of three or more that are the heaviest of one of their members.

    Returns
    -------
    list of (S, k) array of int
        One for each size k.
    """
    from igraph import Graph
    upper = triu(weights, 1).tocoo()
    edges = np.column_stack((upper.row, upper.col))[np.argsort(-upper.data, kind='stable')]
    graph = Graph(n=weights.shape[0], edges=edges)
    while max(graph.coreness(), default=0) > MOST_CORE:
        edges = edges[:int(THINNING * len(edges))]
        graph = Graph(n=weights.shape[0], edges=edges)
    cliques = graph.maximal_cliques(min=3)
    dense = weights.astype(np.float32).toarray()
    heaviest = np.zeros(weights.shape[0])
    chosen = np.zeros(weights.shape[0], np.intp)
    by_size = {}
    for size in sorted({len(clique) for clique in cliques}):
        rows = np.array([i for i, clique in enumerate(cliques) if len(clique) == size])
        sets = np.array([cliques[i] for i in rows])
        # of the pairs of each clique
        weight = sum(dense[sets[:, i], sets[:, j]] for i, j in combinations(range(size), 2))
        # the last to be written stays: the heaviest
        for row in np.argsort(weight, kind='stable'):
            better = weight[row] > heaviest[sets[row]]
            heaviest[sets[row][better]] = weight[row]
            chosen[sets[row][better]] = rows[row] + 1
        by_size[size] = rows, sets
    kept = np.unique(chosen)
    return [sets[np.isin(rows + 1, kept)] for rows, sets in by_size.values()
            if np.isin(rows + 1, kept).any()]
