"""From correspondences to one transformation: the paper's Sec. III-B to III-E on one screen."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import SgorConfig
from ..execution.stopwatch import Stopwatch
from ..index.scan_index import ScanIndex
from ..matching.correspondences import Correspondences
from .consistency import filter_groups
from .graph import consistency_graph
from .grouping import group
from .hypotheses import hypothesise
from .hypotheses import MIN_POINTS
from .refinement import distances
from .refinement import refine
from .refinement import unobservable
from .verification import Normals
from .verification import verify

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Solution:
    """What the solver made of correspondences.

    Attributes
    ----------
    correspondences : Correspondences
    T_target_source : (4, 4) float64 or None
        None where there is no solution, and `reason` says why.
    inliers : (N,) bool
        Correspondences nearer than tau_1 under it, or under what was dropped for `reason`.
    reason : str
        Empty where there is a solution.
    hypotheses : (H, 4, 4) float64
        Candidates of the groups, T_target_source.
    passed_ground_check : (H,) bool
        Which of them survived the first stage of verification.
    hypothesis_scores : (H,) float64
        What they were chosen by, the higher the better; minus infinity where the check failed.
    best_hypothesis : int
        Which of them won the second stage; -1 if none.
    """

    correspondences: Correspondences
    T_target_source: Array | None
    inliers: NDArray[np.bool_]
    reason: str
    hypotheses: Array
    passed_ground_check: NDArray[np.bool_]
    hypothesis_scores: Array
    best_hypothesis: int

    @property
    def ranked_hypotheses(self) -> Array:
        """Those that passed the ground check, (K, 4, 4), the best first."""
        order = np.argsort(-self.hypothesis_scores, kind='stable')
        return self.hypotheses[order[np.isfinite(self.hypothesis_scores[order])]]


def solve(correspondences: Correspondences, ground_normals: Normals | None,
          indexes: tuple[ScanIndex, ScanIndex] | None, config: SgorConfig, clock: Stopwatch
          ) -> Solution:
    """Remove outliers by semantic-geometric consistency and fit (Sec. III-B to III-E).

    Parameters
    ----------
    correspondences : Correspondences
    ground_normals : pair of (3,) float64 or None
        Of source and target, towards their sensors.
    indexes : pair of ScanIndex or None
        Of source and target, for `cloud_check`.
    config : SgorConfig
        At the scale of the scans.
    clock : Stopwatch
    """
    if len(correspondences) < MIN_POINTS:
        return Solution(correspondences, None, np.zeros(len(correspondences), np.bool_),
                        f'only {len(correspondences)} correspondences', np.empty((0, 4, 4)),
                        np.empty(0, np.bool_), np.empty(0), -1)
    with clock('consistency graph'):
        graph = consistency_graph(correspondences, config)
    with clock('grouping'):
        groups = group(correspondences, graph, config)
    with clock('consistency'):
        filtered = filter_groups(correspondences, graph, groups, config.group_keep,
                                 config.semantics)
    with clock('hypotheses'):
        hypotheses = hypothesise(correspondences, filtered)
    with clock('verification'):
        verified = verify(hypotheses, correspondences, ground_normals, indexes, config)
    T, reason = None, verified.reason
    inliers = np.zeros(len(correspondences), np.bool_)
    if verified.best >= 0:
        with clock('refinement'):
            T = refine(hypotheses.T_target_source[verified.best], correspondences, config)
            inliers = distances(T, correspondences.source, correspondences.target) < config.tau_1
        reason = unobservable(correspondences.source[inliers], correspondences.target[inliers],
                              config)
    return Solution(correspondences, None if reason else T, inliers, reason,
                    hypotheses.T_target_source, verified.passed_ground_check, verified.score,
                    verified.best)
