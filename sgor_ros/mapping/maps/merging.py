"""Two maps of one place become one: keyframes of the one are found in the other."""
from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import first_difference
from ...core.config import PREPARATION
from ...core.config import SgorConfig
from ..edge import Edge
from ..keyframe import Keyframes
from ..loops.loop_consistency import LoopConsistency
from ..pose_graph import PoseGraph
from .localisation import locate

if TYPE_CHECKING:
    from .map import Map
    from .map import MapNode

Array = NDArray[np.float64]

TOGETHER = 16
"""Keyframes that are located by one task, where there are processes for it."""
FEWEST = 2
"""So many keyframes of the other map, that agree with each other, join two maps."""


@dataclass(frozen=True, eq=False, repr=False)
class Merged:
    """What became of two maps.

    Attributes
    ----------
    success : bool
    reason : str
        Why they are not one, in words; empty where they are.
    map : Map or None
        Both, in the frame of the first; None without success.
    T_map_other : (4, 4) float64 or None
        Where the frame of the other map lies in the first, by its first node that is found again.
    loops : tuple of Edge
        That join them, from nodes of the first to nodes of the other, by their numbers in `map`.
    found : int
        Keyframes of the other map that were found in the first.
    """

    success: bool
    reason: str
    map: 'Map | None' = None
    T_map_other: Array | None = None
    loops: tuple[Edge, ...] = ()
    found: int = 0

    def __repr__(self) -> str:
        return f'Merged({self.map if self.success else self.reason})'


def merge(known: 'Map', other: 'Map', executor: Executor | None = None) -> Merged:
    """Join two maps: see `Map.merge`."""
    check_alike(other.config, known.config, 'other', 'this map')
    graph = PoseGraph()
    if graph.missing:
        return Merged(False, graph.missing)
    offset = max(known.nodes, default=-1) + 1 - min(other.nodes, default=0)
    moved = [_moved(edge, offset) for edge in other.edges]
    located = {}
    for node, edges in _all_located(known, other, executor):
        located[node + offset] = [replace(edge, source=node + offset) for edge in edges]
    consistency = LoopConsistency()
    consistency.begin_anew([*known.edges, *moved])
    agreeing = _agreeing(located, consistency)
    if len(agreeing) < FEWEST:
        return Merged(False, (
            f'only {len(located)} of {len(other.keyframes)} keyframes of the other map are found '
            f'in this one, and {FEWEST} have to agree' if len(located) < FEWEST else
            f'{len(located)} of {len(other.keyframes)} keyframes of the other map are found in '
            'this one, but not in one arrangement'), found=len(located))
    loops = [edge for source in agreeing for edge in located[source]]
    believed = [edge for loop in loops for edge in consistency.offer(loop, known.mapper_config)]
    if not believed:
        return Merged(False, 'the loops that join the maps contradict each other',
                      found=len(located))
    graph.add_map({node.id: node.T_map_sensor for node in known.nodes.values()}, known.edges)
    graph.add_map({node.id + offset: node.T_map_sensor for node in other.nodes.values()}, moved)
    graph.close(believed)
    joined = replace(known, nodes=_nodes(known, other, offset, graph),
                     edges=tuple(graph.edges), keyframes=_keyframes(known, other, offset))
    first = believed[0].source
    T_map_other = (graph.pose(first)
                   @ se3.inverse(other.nodes[first - offset].T_map_sensor))
    return Merged(True, '', joined, T_map_other, tuple(believed), len(located))


def _all_located(known: 'Map', other: 'Map', executor: Executor | None
                 ) -> Iterable[tuple[int, tuple[Edge, ...]]]:
    """Return the keyframes of the other map that are found in this one, in their order."""
    nodes = [keyframe.id for keyframe in other.keyframes]
    if executor is None:
        return _located(known, other, nodes)
    # what is sent: scans that lie in files are read where they are needed
    known = replace(known, keyframes=known.keyframes.copy(),
                    config=known.config.replace(threads=1))
    tasks = []
    for first in range(0, len(nodes), TOGETHER):
        some = nodes[first:first + TOGETHER]
        part = replace(other, nodes={}, edges=(), keyframes=other.keyframes.copy(some))
        tasks.append(executor.submit(_located, known, part, some))
    return [one for task in tasks for one in task.result()]


def _located(known: 'Map', other: 'Map', nodes: Iterable[int]
             ) -> list[tuple[int, tuple[Edge, ...]]]:
    """Return those of some keyframes that are found, with the loops to them."""
    found = [(node, locate(known, other.keyframes.restored(node))) for node in nodes]
    return [(node, one.edges) for node, one in found if one.success]


def check_alike(one: SgorConfig, other: SgorConfig, name: str, other_name: str) -> None:
    """Refuse configurations whose scans cannot be registered to each other.

    Raises
    ------
    InputError
        Naming the setting that differs.
    """
    if item := first_difference(one, other, (*PREPARATION, 'scale')):
        mine, its = getattr(one, item), getattr(other, item)
        raise InputError(f'{name}: {item} = {mine!r}, but {other_name} was made with {its!r}')


def _agreeing(located: dict[int, list[Edge]], consistency: LoopConsistency) -> list[int]:
    """Return the largest group of keyframes that agree with one, if more do than contradict it."""
    agree: dict[int, list[int]] = {source: [source] for source in located}
    against = dict.fromkeys(located, 0)
    for one, two in combinations(located, 2):
        if consistency.agree(located[one][0], located[two][0]):
            agree[one].append(two)
            agree[two].append(one)
        else:
            against[one] += 1
            against[two] += 1
    best = max(agree, key=lambda source: len(agree[source]), default=None)
    return [] if best is None or len(agree[best]) <= against[best] else sorted(agree[best])


def _moved(edge: Edge, offset: int) -> Edge:
    return replace(edge, target=edge.target + offset, source=edge.source + offset)


def _nodes(known: 'Map', other: 'Map', offset: int, graph: PoseGraph
           ) -> 'dict[int, MapNode]':
    sessions = max(known.sessions, default=-1) + 1
    nodes = [*known.nodes.values(), *(
        replace(node, id=node.id + offset, session=node.session + sessions)
        for node in other.nodes.values())]
    return {node.id: replace(node, T_map_sensor=graph.pose(node.id).copy()) for node in nodes}


def _keyframes(known: 'Map', other: 'Map', offset: int) -> Keyframes:
    joined = known.keyframes.copy()
    for keyframe in other.keyframes:
        joined.put(replace(keyframe, id=keyframe.id + offset))
    return joined
