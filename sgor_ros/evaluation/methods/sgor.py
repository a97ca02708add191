"""SGOR itself, in any configuration."""
from functools import partial

import numpy as np

from ...core.config import SgorConfig
from ...core.registration import register_correspondences
from .problem import Matches
from .problem import Method
from .problem import Solution


def sgor(config: SgorConfig) -> Method:
    """Return SGOR as a method of the tables."""
    return partial(_sgor, config)


def _sgor(config: SgorConfig, matches: Matches) -> Solution:
    found = register_correspondences(
        matches.source, matches.target, matches.source_labels, matches.target_labels,
        ground_normals=matches.ground_normals, config=config)
    # a table counts answers, trusted or not, as it does for the others
    kept = np.flatnonzero(found.inliers) if found.T_target_source is not None else None
    return Solution(found.T_target_source, kept)
