"""Which loops are believed: those that agree with odometry, or with each other (PCM).

A registration stands for itself already: it is refused where the clouds are ambiguous, degenerate
or not of one place. What it cannot know is another place that looks the same. So a loop has to
agree with all that is believed so far, within the covariances. Where odometry is too unsure to
say anything, or where no way leads from one end to the other, it waits for another loop, between
other scans, that closes a cycle with it (pairwise consistency, as in PCM); and as long as others
close cycles that contradict theirs, more have to agree than contradict.

Should a false loop be believed all the same, right ones will contradict it and agree with each
other: then all of them are asked again, by GNC in the pose graph.
"""
from collections.abc import Container
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...tracker.motion import GATE
from ..config import MapperConfig
from ..edge import chained
from ..edge import Edge
from ..edge import squared_distance
from .paths import Paths

Array = NDArray[np.float64]

MAX_WAITING = 20
"""Loops that wait for another; of more the oldest go."""
ENOUGH = 3
"""So many that agree with another against what is believed put it in question."""


class LoopConsistency:
    """What is believed, and what waits.

    Attributes
    ----------
    paths : Paths
        All edges that are believed.
    waiting : list of Edge
        Loops that nothing is known for or against.
    contradicting : list of Edge
        The last loops that did not agree with what is believed.
    contradicted : int
        How many those were, of all.
    """

    def __init__(self) -> None:
        self.paths = Paths()
        self.waiting: list[Edge] = []
        self.contradicting: list[Edge] = []
        self.contradicted = 0

    def offer(self, loop: Edge, config: MapperConfig) -> list[Edge]:
        """Return the loops that are believed now that there is one more."""
        known = self.paths.between(loop.target, loop.source)
        if known is not None:
            if not _fit(loop, *known):
                self.contradicted += 1
                self.contradicting = [*self.contradicting, loop][-MAX_WAITING:]
                return []
            if known[1][:3, :3].trace() < config.trusted_drift**2:
                return self._believe([loop])
        verdicts = [(other, self.agree(loop, other)) for other in self.waiting]
        agreeing = [other for other, agrees in verdicts if agrees]
        against = [other for other, agrees in verdicts if agrees is False]
        self.waiting = [*self.waiting, loop][-MAX_WAITING:]
        if len(agreeing) <= len(against):
            return []
        return self._believe([loop, *agreeing])

    def agree(self, loop: Edge, other: Edge) -> bool | None:
        """Whether two loops close a cycle; None where no way leads from one to the other."""
        targets = self.paths.between(loop.target, other.target)
        sources = ((np.eye(4), np.zeros((6, 6))) if loop.source == other.source else
                   self.paths.between(other.source, loop.source))
        if targets is None or sources is None:
            return None
        round_trip = [Edge(0, 0, *targets), other, Edge(0, 0, *sources)]
        return _fit(loop, *chained(round_trip))

    def in_question(self) -> bool:
        """Whether what is believed should be asked again.

        So many loops that contradict it agree with the last of them, and more than do not.
        """
        if len(self.contradicting) <= ENOUGH:
            return False
        last = self.contradicting[-1]
        verdicts = [self.agree(last, other) for other in self.contradicting[:-1]]
        return verdicts.count(True) >= max(ENOUGH, verdicts.count(False) + 1)

    def begin_anew(self, believed: Sequence[Edge]) -> None:
        """Believe these edges and no others; what contradicted the old ones is forgotten."""
        self.contradicting = []
        self.paths = _paths(believed)

    def keep(self, nodes: Container[int], believed: Sequence[Edge]) -> None:
        """Believe these edges and no others; forget loops at other nodes than these."""
        self.waiting, self.contradicting = (
            [loop for loop in loops if loop.source in nodes and loop.target in nodes]
            for loops in (self.waiting, self.contradicting))
        self.paths = _paths(believed)

    def _believe(self, loops: list[Edge]) -> list[Edge]:
        """Take in loops that agree with the first; those that contradict each other stay out."""
        believed: list[Edge] = []
        for loop in loops:
            known = self.paths.between(loop.target, loop.source) if believed else None
            if known is None or _fit(loop, *known):
                self.paths.add(loop)
                believed.append(loop)
        self.waiting = [other for other in self.waiting if all(other is not one for one in loops)]
        return believed


def _paths(edges: Sequence[Edge]) -> Paths:
    paths = Paths()
    for edge in edges:
        paths.add(edge)
    return paths


def _fit(loop: Edge, T_target_source: Array, covariance: Array) -> bool:
    """Whether a loop lies where it is expected, within both covariances."""
    return squared_distance(loop.T_target_source, T_target_source,
                            covariance + loop.covariance) <= GATE
