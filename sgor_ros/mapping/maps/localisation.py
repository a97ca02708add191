"""Where in a map a scan was taken: retrieval proposes keyframes, registration decides.

A place counts as found where two keyframes agree and none at another place does. So that the
latter is known, what looks nearly as much alike at other places is tried too.
"""
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.checks import as_pose
from ...core.config import prepares_alike
from ...core.config import SgorConfig
from ...core.execution.threads import cores
from ...core.execution.threads import parallel_for
from ...core.prepared_scan import as_scan
from ...core.prepared_scan import PreparedScan
from ...core.preprocessing import at_scale
from ...core.preprocessing import preprocess
from ...core.registration import register
from ...core.registration import Scan
from ...core.registration import with_few_keypoints
from ...core.verdict.result import Result
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
two agree, the best of them by all that `register` has,"""
HOPELESS = 0.005
"""but for those whose quick attempt had no more confidence: of 432 at foreign places 99 % do, of
1,441 at the right one with wrong labels or other beams none did that led to an answer."""
MOST_ALIKE = 200
"""Keyframes that are asked for; a long street has that many within `loop_radius` of a place."""
NEIGHBOURS = 2
"""Keyframes around an answer that are asked next whether they agree."""
AT_ONCE = 2
"""Keyframes that are registered to at once, each on its share of the cores."""
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
        self._confidences: dict[int, float] = {}
        self._restored: dict[int, PreparedScan] = {}
        self._known = known
        self._prepared = prepared
        self._sources = {prepared.scale: prepared}
        self._alike = known.keyframes.alike(prepared, MOST_ALIKE)
        self._radius = known.mapper_config.loop_radius * self.scale
        near = [] if hint is None else self._near(hint)[:HINTED]
        self._order = list(dict.fromkeys([*near, *self._alike]))

    def run(self) -> None:
        """Try keyframes until two agree, and then those of other places."""
        config = self._known.config
        quick = with_few_keypoints(config).replace(unlabelled_attempt=False)
        if self._round(self._order[:QUICK], quick) or self._round(
                self._promising(), config.replace(quick_keypoints=0)):
            self._attempt(self._elsewhere(self.found()[0]), quick)

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

    def _round(self, nodes: list[int], config: SgorConfig) -> bool:
        """Try keyframes, and those near an answer next; return whether two agree."""
        tried = {place.keyframe for place, _ in self.answers}
        waiting = [node for node in nodes if node not in tried]
        while waiting:
            these, waiting = waiting[:AT_ONCE], waiting[AT_ONCE:]
            tried.update(these)
            places = self._attempt(these, config)
            if places and len(self.found()[0]) > 1:
                return True
            near = [node for place in places for node in self._near(place.T_map_sensor)
                    if node not in tried][:NEIGHBOURS]
            waiting = list(dict.fromkeys([*near, *waiting]))
        return False

    def _promising(self) -> list[int]:
        """Return the keyframes for a thorough attempt: those whose quick one was the best."""
        order = sorted(self._confidences, key=self._confidences.__getitem__, reverse=True)
        return [node for node in order if self._confidences[node] > HOPELESS][:THOROUGH]

    def _attempt(self, nodes: list[int], config: SgorConfig) -> list[Place]:
        """Register the scan to keyframes; return the answers of those that gave one."""
        threads = config.threads
        config = config.replace(threads=max(threads // AT_ONCE, 1))
        found: dict[int, Result] = {}

        def run(first: int, last: int) -> None:
            for node in nodes[first:last]:
                result = self._registered(node, config)
                if result is not None:
                    found[node] = result

        with cores(threads):
            parallel_for(run, len(nodes))
        answers = [self._noted(node, found[node]) for node in nodes if node in found]
        return [place for place in answers if place is not None]

    def _registered(self, node: int, config: SgorConfig) -> Result | None:
        """Return what registering the scan to a keyframe gives; None where they do not fit."""
        if node not in self._restored:
            self._restored[node] = self._known.keyframes[node].scan.restored()
        target = self._restored[node]
        if not prepares_alike(target.config, config):
            return None
        if target.scale not in self._sources:
            if self._prepared.scan is None:    # nothing to prepare again
                return None
            self._sources[target.scale] = at_scale(self._prepared, target.scale)
        return register(self._sources[target.scale], target, config)

    def _noted(self, node: int, found: Result) -> Place | None:
        """Note what a registration to a keyframe gave; return the answer, if it is one."""
        self.attempts += 1
        self._confidences[node] = found.confidence
        if found.T_target_source is None:
            return None
        T_map_target = self._known.nodes[node].T_map_sensor
        frames = self._prepared.frame_covariance, self._known.keyframes[node].frame_covariance
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
        return [node for node in rivals if node not in self._confidences]


def locate(known: 'Map', scan: Scan | ArrayLike, hint: ArrayLike | None = None) -> Located:
    """Find where in the map a scan was taken: see `Map.locate`."""
    given = as_scan(scan, 'scan')
    if isinstance(given, PreparedScan):
        given.check(known.config, 'scan')
        prepared = given
    else:
        prepared = preprocess(given, known.config)
    expected = None if hint is None else as_pose(hint, 'hint')
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
