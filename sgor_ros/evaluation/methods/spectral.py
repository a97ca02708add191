"""Spectral matching (Leordeanu and Hebert, ICCV 2005), as PointDSC's baseline has it."""
import numpy as np

from ...core.solver.hypotheses import fit_transforms
from .compatibility import leading_eigenvector
from .compatibility import length_differences
from .compatibility import with_values
from .compatibility import without_diagonal
from .interface import Answer
from .interface import Matches

SIGMA_SHARE = 1 / 3
"""sigma_d of the affinity 4.5 - c^2 / (2 sigma_d^2), of the inlier threshold."""
TOP_SHARE = 0.1
ROUNDS = 10


def spectral_matching(matches: Matches) -> Answer:
    """Keep the tenth with the largest entries of the leading eigenvector, and fit to them."""
    sigma = SIGMA_SHARE * matches.inlier_m
    c = length_differences(matches.source, matches.target, 3 * sigma)
    affinity = without_diagonal(with_values(c, 4.5 - c.data**2 / (2 * sigma**2)))
    confidence = leading_eigenvector(affinity, ROUNDS)
    kept = np.argsort(-confidence, kind='stable')[:int(TOP_SHARE * len(confidence))]
    kept = kept[confidence[kept] > 0]
    if len(kept) < 3:
        return Answer(None)
    T, = fit_transforms(matches.source[kept][None], matches.target[kept][None],
                        confidence[kept][None])
    return Answer(T, kept)
