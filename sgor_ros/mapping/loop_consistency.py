"""Which loops are believed: those that agree with odometry, or with each other (PCM).

A registration stands for itself already: it is refused where the clouds are ambiguous, degenerate
or not of one place. What it cannot know is another place that looks the same. So a loop has to
agree with all that is believed so far, within the covariances. Where odometry is too unsure to
say anything, or where no way leads from one end to the other, it waits for another loop, between
other scans, that closes a cycle with it (pairwise consistency, as in PCM); and as long as others
close cycles that contradict theirs, more have to agree than contradict.
"""
import numpy as np
from numpy.typing import NDArray

from ..tracker.motion import GATE
from .config import MapperConfig
from .edge import chained
from .edge import Edge
from .edge import squared_distance
from .paths import Paths

Array = NDArray[np.float64]

MAX_WAITING = 20
"""Loops that wait for another; of more the oldest go."""


class LoopConsistency:
    """What is believed, and what waits.

    Attributes
    ----------
    paths : Paths
        All edges that are believed.
    waiting : list of Edge
        Loops that are neither believed nor contradicted.
    contradicted : int
        Loops so far that did not agree with what is believed.
    """

    def __init__(self) -> None:
        self.paths = Paths()
        self.waiting: list[Edge] = []
        self.contradicted = 0

    def offer(self, loop: Edge, config: MapperConfig) -> list[Edge]:
        """Return the loops that are believed now that there is one more."""
        known = self.paths.between(loop.target, loop.source)
        if known is not None:
            if not _fit(loop, *known):
                self.contradicted += 1
                return []
            if known[1][:3, :3].trace() < config.trusted_drift**2:
                return self._believe([loop])
        verdicts = [(other, self._agree(loop, other)) for other in self.waiting]
        agreeing = [other for other, agrees in verdicts if agrees]
        contradicting = [other for other, agrees in verdicts if agrees is False]
        self.waiting = [*self.waiting, loop][-MAX_WAITING:]
        if len(agreeing) <= len(contradicting):
            return []
        return self._believe([loop, *agreeing])

    def _believe(self, loops: list[Edge]) -> list[Edge]:
        """Take in loops that agree with the first; those that contradict each other stay out."""
        believed = []
        for loop in loops:
            known = self.paths.between(loop.target, loop.source) if believed else None
            if known is None or _fit(loop, *known):
                self.paths.add(loop)
                believed.append(loop)
        self.waiting = [other for other in self.waiting if all(other is not one for one in loops)]
        return believed

    def _agree(self, loop: Edge, other: Edge) -> bool | None:
        """Whether two loops close a cycle; None where no way leads from one to the other."""
        targets = self.paths.between(loop.target, other.target)
        sources = self.paths.between(other.source, loop.source)
        if targets is None or sources is None:
            return None
        round_trip = [Edge(0, 0, *targets), other, Edge(0, 0, *sources)]
        return _fit(loop, *chained(round_trip))


def _fit(loop: Edge, T_target_source: Array, covariance: Array) -> bool:
    """Whether a loop lies where it is expected, within both covariances."""
    return squared_distance(loop.T_target_source, T_target_source,
                            covariance + loop.covariance) <= GATE
