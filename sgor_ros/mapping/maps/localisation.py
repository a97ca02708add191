"""Where in a map a scan was taken: retrieval proposes keyframes, registration decides.

A place counts as found where two keyframes agree and none at another place does. So that the
latter is known, what looks nearly as much alike at other places is tried too.
"""
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import prepares_alike
from ...core.prepared_scan import as_scan
from ...core.prepared_scan import PreparedScan
from ...core.preprocessing import at_scale
from ...core.preprocessing import preprocess
from ...core.registration import register
from ...core.registration import Scan
from ...core.verdict.result import Status
from ..edge import Edge
from ..edge import Kind

if TYPE_CHECKING:
    from .map import Map

Array = NDArray[np.float64]

ATTEMPTS = 8
"""Keyframes that are tried at most, besides those at other places."""
RIVALS = 2
"""Keyframes at other places that are tried before a place counts as found,"""
AS_ALIKE = 0.8
"""if their likeness is at least this share of that of the keyframes that found it."""
AGREE_M, AGREE_RAD = 0.5, np.radians(3.0)
"""Answers of two keyframes of one place differ by no more; the map may be bent as far."""
HINTED = 3
"""Keyframes near a hint that come first."""
NOBODY = -1
"""In place of the node of a scan that is in no graph."""


@dataclass(frozen=True, eq=False)
class Place:
    """A pose in the map that a scan may have been taken at.

    Attributes
    ----------
    T_map_sensor : (4, 4) float64
        Metres.
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the map frame, m^2 and rad^2: that of the
        registration; what is unsure of the keyframe's own pose is not in it.
    confidence : float
        0 to 1, as of `Registration`.
    keyframe : int
        The node that it was registered to.
    """

    T_map_sensor: Array
    covariance: Array | None
    confidence: float
    keyframe: int


@dataclass(frozen=True, eq=False, repr=False)
class Located:
    """Where in a map a scan was taken.

    Attributes
    ----------
    status : Status
        REGISTERED, AMBIGUOUS where several places of the map fit, DEGENERATE where the scan slides
        along the place, or REFUSED.
    reason : str
        Why it is not found, in words; empty where it is.
    T_map_sensor : (4, 4) float64 or None
        Pose of the sensor in the map, metres. Without success a candidate to look at and not to
        use; None where there is none.
    covariance, confidence, keyframe
        As of `Place`; None without T_map_sensor.
    alternatives : tuple of Place
        The other places; not empty only where it is AMBIGUOUS.
    attempts : int
        Keyframes that it was registered to.
    edges : tuple of Edge
        From keyframes that answered to the scan, which is node -1.
    """

    status: Status
    reason: str
    T_map_sensor: Array | None = None
    covariance: Array | None = None
    confidence: float = 0.0
    keyframe: int | None = None
    alternatives: tuple[Place, ...] = ()
    attempts: int = 0
    edges: tuple[Edge, ...] = ()

    @property
    def success(self) -> bool:
        """Whether the pose may be used: the status is REGISTERED."""
        return self.status is Status.REGISTERED

    def __repr__(self) -> str:
        if self.T_map_sensor is None:
            return f'Located({self.status}: {self.reason})'
        at = ' '.join(f'{v:.2f}' for v in self.T_map_sensor[:3, 3])
        return f'Located({self.status}{self.reason and ": "}{self.reason}, at {at} m)'


class Search:
    """The answers of the keyframes that have been tried for one scan."""

    def __init__(self, known: 'Map', prepared: PreparedScan) -> None:
        self.known = known
        self.prepared = prepared
        self.answers: list[tuple[Place, Edge]] = []
        self.unsure: list[tuple[Status, Place]] = []
        self.tried: set[int] = set()

    def attempt(self, node: int) -> None:
        """Register the scan to a keyframe."""
        self.tried.add(node)
        target = self.known.keyframes.restored(node)
        if not prepares_alike(target.config, self.known.config):
            return
        source = self.prepared
        if source.scale != target.scale:
            if source.scan is None:    # nothing to prepare again
                return
            source = at_scale(source, target.scale)
        found = register(source, target, self.known.config)
        if found.T_target_source is None:
            return
        T_map_target = self.known.poses([node])[0]
        placements = [(found.T_target_source, found.covariance),
                      *((other.T_target_source, other.covariance) for other in found.alternatives)]
        for T, covariance in placements:
            place = Place(T_map_target @ T, _turned(covariance, T_map_target), found.confidence,
                          node)
            if found.success and covariance is not None:
                self.answers.append((place, Edge(node, NOBODY, T, covariance, Kind.LOOP)))
            elif found.status in (Status.AMBIGUOUS, Status.DEGENERATE):
                self.unsure.append((found.status, place))

    def found(self) -> list[list[Place]]:
        """Return the places that keyframes answered, most agreed on first."""
        scale, places = self.prepared.scale, [place for place, _ in self.answers]
        groups: list[list[Place]] = []
        for place in sorted(places, key=lambda one: -one.confidence):
            for group in groups:
                if _agree(group[0], place, scale):
                    group.append(place)
                    break
            else:
                groups.append([place])
        return sorted(groups, key=len, reverse=True)


def locate(known: 'Map', scan: Scan | ArrayLike, hint: ArrayLike | None = None) -> Located:
    """Find where in a map a scan was taken: see `Map.locate`."""
    given = as_scan(scan, 'scan')
    if isinstance(given, PreparedScan):
        given.check(known.config, 'scan')
        prepared = given
    else:
        prepared = preprocess(given, known.config)
    expected = None if hint is None else _checked(hint)
    if not len(known.keyframes):
        return Located(Status.REFUSED, 'the map has no keyframes')
    alike = known.keyframes.alike(prepared)
    search = Search(known, prepared)
    agreed: list[Place] = []
    for node in _order(known, alike, expected, prepared.scale):
        search.attempt(node)
        agreed = next((group for group in search.found() if len(group) > 1), [])
        if agreed:
            break
    if agreed:
        for node in _rivals(search, alike, agreed):
            search.attempt(node)
    return _judged(search)


def _order(known: 'Map', alike: dict[int, float], hint: Array | None, scale: float
           ) -> Iterator[int]:
    """Yield keyframes to try: a few near a hint, and those that look most alike."""
    order = list(alike)
    if hint is not None:
        distance = np.linalg.norm(known.poses(order)[:, :3, 3] - hint[:3, 3], axis=1)
        near = [order[row] for row in np.argsort(distance)[:HINTED]
                if distance[row] < known.mapper_config.loop_radius * scale]
        order = list(dict.fromkeys([*near, *order]))
    yield from order[:ATTEMPTS]


def _rivals(search: Search, alike: dict[int, float], agreed: list[Place]) -> list[int]:
    """Return keyframes at other places that look nearly as much alike."""
    known, radius = search.known, search.known.mapper_config.loop_radius * search.prepared.scale
    nodes = list(alike)
    distance = np.linalg.norm(known.poses(nodes)[:, :3, 3] - agreed[0].T_map_sensor[:3, 3],
                              axis=1)
    bound = AS_ALIKE * max(alike[place.keyframe] for place in agreed)
    elsewhere = [node for node, far in zip(nodes, distance > radius, strict=True)
                 if far and alike[node] >= bound][:RIVALS]
    return [node for node in elsewhere if node not in search.tried]


def _judged(search: Search) -> Located:
    """Return what the answers come to."""
    groups, attempts = search.found(), len(search.tried)
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
        reason = (f'only one of {attempts} keyframes that look alike can be registered to, and '
                  'none agrees with it')
    first = best[0]
    return Located(status, reason, first.T_map_sensor, first.covariance,
                   first.confidence / len(groups), first.keyframe,
                   tuple(group[0] for group in others), attempts, edges)


def _unsure(search: Search, attempts: int) -> Located:
    """Return the result where no keyframe was registered to."""
    if not search.unsure:
        return Located(Status.REFUSED, f'none of {attempts} keyframes that look alike can be '
                       'registered to', attempts=attempts)
    status, best = max(search.unsure, key=lambda one: one[1].confidence)
    others: list[Place] = []
    for _, place in search.unsure:
        if not any(_agree(place, one, search.prepared.scale) for one in (best, *others)):
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
