"""Which pairs to try and when: near by as far as the pose is sure, and alike wherever they are."""
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..core.index.range_image import view_overlap
from ..core.prepared_scan import PreparedScan
from .config import MapperConfig
from .keyframe import Keyframes
from .odometry import Node
from .paths import Paths
from .pose_graph import PoseGraph

Array = NDArray[np.float64]

SIGMAS = 3.0
"""So many standard deviations of the position are searched beyond the radius."""
ROUND_ABOUT = 2
"""To a neighbour one drives straight; to a loop leads a way that is longer by so many keyframes.
"""

SAME_VIEW = 0.5
"""Share of a view that a keyframe has to see too, to cover it."""


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

    def add(self, source: int, prepared: PreparedScan, targets: list[int], limit: int) -> None:
        """Let the pairs of a new node wait, best first."""
        if targets:
            self._waiting.append((source, prepared, deque(targets)))
        while len(self._waiting) > limit:
            self.put_off += len(self._waiting.popleft()[2])

    def take(self, count: int) -> list[Candidate]:
        """Return up to so many pairs to try next; they do not wait any more."""
        taken: list[Candidate] = []
        while self._waiting and len(taken) < count:
            source, prepared, targets = self._waiting[-1]
            taken.append(Candidate(source, prepared, targets.popleft()))
            if not targets:
                self._waiting.pop()
        return taken


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is near a new node, as far as its pose is sure.

    Attributes
    ----------
    node : Node
    prepared : PreparedScan
    keyframes : Keyframes
    graph : PoseGraph
    paths : Paths
    config : MapperConfig
    """

    node: Node
    prepared: PreparedScan
    keyframes: Keyframes
    graph: PoseGraph
    paths: Paths
    config: MapperConfig

    def candidates(self, nodes: Mapping[int, Node]) -> list[int]:
        """Return the keyframes to try for the node, best first."""
        c, scale = self.config, self.prepared.scale
        radius, straight = c.loop_radius * scale, ROUND_ABOUT * c.keyframe_spacing * scale
        near: list[tuple[float, int]] = []
        elsewhere = set(self._others)
        for other, distance, sigma in self._distances:
            way = abs(self.node.way - nodes[other].way)
            if way < distance + straight or distance > radius + SIGMAS * sigma:
                continue
            near.append((distance, other))
            if SIGMAS * sigma > radius:    # then nearness says little
                elsewhere.add(other)
        chosen = [other for _, other in sorted(near)][:c.near_candidates]
        if elsewhere:
            alike = [other for other in self.keyframes.alike(self.prepared) if other in elsewhere]
            chosen = [*alike[:c.alike_candidates], *chosen]
        return list(dict.fromkeys(chosen))

    def is_covered(self) -> bool:
        """Return whether a keyframe stands so near that another would add nothing.

        It has to look the same way, too: sensors of narrow view see something else behind.
        """
        spacing = self.config.keyframe_spacing * self.prepared.scale
        R_map_sensor = self.graph.pose(self.node.id)[:3, :3]
        return any(
            distance < spacing and sigma < spacing / 2 and view_overlap(
                self.prepared.index.ranges, self.graph.pose(other)[:3, :3].T @ R_map_sensor
            ) >= SAME_VIEW
            for other, distance, sigma in self._distances)

    @cached_property
    def _others(self) -> list[int]:
        """Keyframes of other parts of the map."""
        part = self.graph.part(self.node.id)
        return [one.id for one in self.keyframes if self.graph.part(one.id) != part]

    @cached_property
    def _distances(self) -> list[tuple[int, float, float]]:
        """Keyframes of the same part, with their distance and its standard deviation, metres."""
        part = self.graph.part(self.node.id)
        ids = [one.id for one in self.keyframes if self.graph.part(one.id) == part]
        if not ids:
            return []
        ways = self.graph.poses(ids)[:, :3, 3] - self.graph.pose(self.node.id)[:3, 3]
        return list(zip(ids, np.linalg.norm(ways, axis=1).tolist(),
                        self.paths.sigmas(self.node.id, ids).tolist(), strict=True))
