"""Where in a map a scan was taken: retrieval proposes keyframes, registration decides.

A place counts as found where two keyframes agree and none at another place does. So that the
latter is known, what looks nearly as much alike at other places is tried too.
"""
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import prepares_alike
from ...core.config import SgorConfig
from ...core.prepared_scan import as_scan
from ...core.prepared_scan import PreparedScan
from ...core.preprocessing import at_scale
from ...core.preprocessing import preprocess
from ...core.registration import register
from ...core.registration import Scan
from ...core.registration import with_few_keypoints
from ...core.verdict.result import Status
from ...tracker.deskewing import with_frames
from ..edge import Edge
from ..edge import Kind
from ..edge import NO_NODE
from .result import Located
from .result import Place

if TYPE_CHECKING:
    from .map import Map

Array = NDArray[np.float64]

QUICK, THOROUGH = 8, 3
"""Keyframes that look alike and are tried at most: first by a quick attempt each, then, where no
two agree, the first of them by all that `register` has."""
MOST_ALIKE = 200
"""Keyframes that are asked for; a long street has that many within `loop_radius` of a place."""
NEIGHBOURS = 2
"""Keyframes around an answer that are asked next whether they agree."""
RIVALS = 2
"""Keyframes at other places that are tried before a place counts as found,"""
AS_ALIKE = 0.8
"""if their likeness is at least this share of that of the keyframes that found it."""
AGREE_M, AGREE_RAD = 0.5, np.radians(3.0)
"""Answers of two keyframes of one place differ by no more; the map may be bent as far."""
HINTED = 3
"""Keyframes near a hint that come first."""


class Search:
    """The answers of the keyframes that have been tried for one scan.

    Attributes
    ----------
    answers : list of (Place, Edge)
    unsure : list of (Status, Place)
        Of registrations that leave several answers, or slide.
    attempts : int
    """

    def __init__(self, known: 'Map', prepared: PreparedScan, hint: Array | None) -> None:
        self.scale = prepared.scale
        self.answers: list[tuple[Place, Edge]] = []
        self.unsure: list[tuple[Status, Place]] = []
        self.attempts = 0
        self._tried: set[int] = set()
        self._known = known
        self._prepared = prepared
        self._alike = known.keyframes.alike(prepared, MOST_ALIKE)
        self._radius = known.mapper_config.loop_radius * self.scale
        near = [] if hint is None else self._near(hint)[:HINTED]
        self._order = list(dict.fromkeys([*near, *self._alike]))

    def run(self) -> None:
        """Try keyframes until two agree, and then those of other places."""
        quick = with_few_keypoints(self._known.config).replace(unlabelled_attempt=False)
        if self._round(quick, QUICK) or self._round(self._known.config, THOROUGH):
            for node in self._elsewhere(self.found()[0]):
                self._attempt(node, quick)

    def found(self) -> list[list[Place]]:
        """Return the places that keyframes answered, most agreed on first."""
        groups: list[list[Place]] = []
        for place, _ in sorted(self.answers, key=lambda one: -one[0].confidence):
            for group in groups:
                if _agree(group[0], place, self.scale):
                    group.append(place)
                    break
            else:
                groups.append([place])
        return sorted(groups, key=len, reverse=True)

    def _round(self, config: SgorConfig, count: int) -> bool:
        """Try what looks alike, and what is near an answer; return whether two agree."""
        tried = {place.keyframe for place, _ in self.answers}
        for node in self._order[:count]:
            waiting = [node]
            while waiting:
                one = waiting.pop(0)
                if one in tried:
                    continue
                tried.add(one)
                place = self._attempt(one, config)
                if place is None:
                    continue
                if len(self.found()[0]) > 1:
                    return True
                waiting = [near for near in self._near(place.T_map_sensor)
                           if near not in tried][:NEIGHBOURS]
        return False

    def _attempt(self, node: int, config: SgorConfig) -> Place | None:
        """Register the scan to a keyframe; return the answer, if it gave one."""
        target, source = self._known.keyframes.restored(node), self._prepared
        if not prepares_alike(target.config, config):
            return None
        if source.scale != target.scale:
            if source.scan is None:    # nothing to prepare again
                return None
            source = at_scale(source, target.scale)
        self.attempts += 1
        self._tried.add(node)
        found = register(source, target, config)
        if found.T_target_source is None:
            return None
        T_map_target = self._known.nodes[node].T_map_sensor
        frames = source.frame_covariance, self._known.keyframes[node].frame_covariance
        placements = [(T, None if covariance is None else with_frames(covariance, T, *frames))
                      for T, covariance in ((found.T_target_source, found.covariance), *(
                          (other.T_target_source, other.covariance)
                          for other in found.alternatives))]
        places = [Place(T_map_target @ T, _turned(covariance, T_map_target), found.confidence,
                        node) for T, covariance in placements]
        T, covariance = placements[0]
        if found.success and covariance is not None:
            self.answers.append((places[0], Edge(node, NO_NODE, T, covariance, Kind.LOOP)))
            return places[0]
        if found.status in (Status.AMBIGUOUS, Status.DEGENERATE):
            self.unsure += [(found.status, place) for place in places]
        return None

    def _near(self, T_map_sensor: Array) -> list[int]:
        """Return the keyframes around a pose, nearest first."""
        nodes, positions = self._known.positions
        distance = np.linalg.norm(positions - T_map_sensor[:3, 3], axis=1)
        rows = np.flatnonzero(distance < self._radius)
        return [nodes[row] for row in rows[np.argsort(distance[rows])][:HINTED + NEIGHBOURS]]

    def _elsewhere(self, agreed: list[Place]) -> list[int]:
        """Return keyframes at other places that look nearly as much alike, but for those tried."""
        nodes = list(self._alike)
        way = self._known.poses(nodes)[:, :3, 3] - agreed[0].T_map_sensor[:3, 3]
        far = np.linalg.norm(way, axis=1) > self._radius
        bound = AS_ALIKE * max(self._alike.get(place.keyframe, 0.0) for place in agreed)
        rivals = [node for node, is_far in zip(nodes, far, strict=True)
                  if is_far and self._alike[node] >= bound][:RIVALS]
        return [node for node in rivals if node not in self._tried]


def locate(known: 'Map', scan: Scan | ArrayLike, hint: ArrayLike | None = None) -> Located:
    """Find where in the map a scan was taken: see `Map.locate`."""
    given = as_scan(scan, 'scan')
    if isinstance(given, PreparedScan):
        given.check(known.config, 'scan')
        prepared = given
    else:
        prepared = preprocess(given, known.config)
    expected = None if hint is None else _checked(hint)
    if not len(known.keyframes):
        return Located(Status.REFUSED, 'the map has no keyframes')
    search = Search(known, prepared, expected)
    search.run()
    return _judged(search)


def _judged(search: Search) -> Located:
    """Return what the answers come to."""
    groups, attempts = search.found(), search.attempts
    edges = tuple(edge for _, edge in search.answers)
    if not groups:
        return _unsure(search, attempts)
    best, *others = groups
    status, reason = Status.REGISTERED, ''
    if others:
        status = Status.AMBIGUOUS
        reason = f'{len(groups)} places of the map fit'
    elif len(best) == 1:
        status = Status.REFUSED
        reason = f'of {attempts} registrations one is right by itself, and none agrees with it'
    first = best[0]
    return Located(status, reason, first.T_map_sensor, first.covariance,
                   first.confidence / len(groups), first.keyframe,
                   tuple(group[0] for group in others), attempts, edges)


def _unsure(search: Search, attempts: int) -> Located:
    """Return the result where no keyframe was registered to."""
    if not search.unsure:
        return Located(Status.REFUSED, f'none of {attempts} registrations to keyframes that look '
                       'alike succeeds', attempts=attempts)
    status, best = max(search.unsure, key=lambda one: one[1].confidence)
    others: list[Place] = []
    for _, place in search.unsure:
        if not any(_agree(place, one, search.scale) for one in (best, *others)):
            others.append(place)
    if others:
        status, reason = Status.AMBIGUOUS, f'{len(others) + 1} places of the map fit'
    else:
        status, reason = Status.DEGENERATE, 'along some direction nothing holds the scan'
    return Located(status, reason, best.T_map_sensor, best.covariance,
                   best.confidence / (len(others) + 1), best.keyframe, tuple(others), attempts)


def _agree(one: Place, other: Place, scale: float) -> bool:
    """Whether two answers of different keyframes, or of one, are of the same place."""
    T = se3.inverse(one.T_map_sensor) @ other.T_map_sensor
    return (float(np.linalg.norm(T[:3, 3])) <= AGREE_M * scale
            and se3.angle(T[:3, :3]) <= AGREE_RAD)


def _turned(covariance: Array | None, T_map_target: Array) -> Array | None:
    """Return a covariance in the target frame as one in the map frame."""
    if covariance is None:
        return None
    J = se3.turned(T_map_target[:3, :3])
    return J @ covariance @ J.T


def _checked(hint: ArrayLike) -> Array:
    T = np.asarray(hint, np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all() or not np.allclose(
            T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-3):
        raise InputError('hint: expected a pose (4, 4)')
    return T
