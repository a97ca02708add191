"""Which pairs to try and when: near by as far as the pose is sure, and alike wherever they are."""
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.prepared_scan import PreparedScan
from .config import MapperConfig
from .keyframe import Keyframes
from .odometry import Node
from .paths import Paths
from .pose_graph import PoseGraph

Array = NDArray[np.float64]

SIGMAS = 3.0
"""So many standard deviations of the position are searched beyond the radius."""
ROUND_ABOUT = 2.0
"""Neighbours are reached by driving straight there; a loop comes by a way that is longer by this
factor, and by two keyframes."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A keyframe that a scan may be of the same place as."""

    source: int
    prepared: PreparedScan
    target: int


class Candidates:
    """Pairs that wait to be registered, the newest scan first.

    Attributes
    ----------
    put_off : int
        Pairs that were dropped because too many waited.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, PreparedScan, deque[int]]] = deque()
        self.put_off = 0

    def __len__(self) -> int:
        return sum(len(targets) for *_, targets in self._waiting)

    def add(self, node: Node, prepared: PreparedScan, targets: list[int], limit: int) -> None:
        """Let the pairs of a new node wait, best first."""
        if targets:
            self._waiting.append((node.id, prepared, deque(targets)))
        while len(self._waiting) > limit:
            self.put_off += len(self._waiting.popleft()[2])

    def next(self) -> Candidate | None:
        """Return the pair to try next; None where nothing waits."""
        if not self._waiting:
            return None
        source, prepared, targets = self._waiting[-1]
        candidate = Candidate(source, prepared, targets.popleft())
        if not targets:
            self._waiting.pop()
        return candidate

    def done(self, source: int) -> None:
        """Drop what is left of a scan: it is placed."""
        self._waiting = deque(one for one in self._waiting if one[0] != source)


def candidates_of(node: Node, prepared: PreparedScan, keyframes: Keyframes, graph: PoseGraph,
                  paths: Paths, nodes: Mapping[int, Node], config: MapperConfig) -> list[int]:
    """Return the keyframes to try for a new node, best first."""
    sigmas = paths.sigmas(node.id)
    radius = config.loop_radius * prepared.scale
    near: list[tuple[float, int]] = []
    elsewhere = set[int]()
    for keyframe in keyframes:
        if graph.part(keyframe.id) != graph.part(node.id):
            elsewhere.add(keyframe.id)
            continue
        distance = _distance(graph, node.id, keyframe.id)
        way = abs(node.way - nodes[keyframe.id].way)
        if way < ROUND_ABOUT * (distance + config.keyframe_spacing * prepared.scale):
            continue
        sigma = sigmas.get(keyframe.id, np.inf)
        if distance < radius + SIGMAS * sigma:
            near.append((distance, keyframe.id))
            if SIGMAS * sigma > radius:    # then nearness says little
                elsewhere.add(keyframe.id)
    chosen = [keyframe for _, keyframe in sorted(near)][:config.near_candidates]
    if elsewhere:
        alike = [other for other in keyframes.alike(prepared) if other in elsewhere]
        chosen = [*alike[:config.alike_candidates], *chosen]
    return list(dict.fromkeys(chosen))


def is_covered(node: Node, keyframes: Keyframes, graph: PoseGraph, paths: Paths, spacing: float
               ) -> bool:
    """Return whether a keyframe stands so near that another would add nothing."""
    near = {keyframe.id for keyframe in keyframes
            if graph.part(keyframe.id) == graph.part(node.id)
            and _distance(graph, node.id, keyframe.id) < spacing}
    if not near:
        return False
    sigmas = paths.sigmas(node.id)
    return any(sigmas[other] < spacing / 2 for other in near)


def _distance(graph: PoseGraph, one: int, other: int) -> float:
    return float(np.linalg.norm(graph.poses[one][:3, 3] - graph.poses[other][:3, 3]))


