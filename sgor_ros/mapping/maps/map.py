"""`Map`: nodes with poses, edges between them, and the scans of some: what a drive leaves."""
from collections.abc import Iterable
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ...core.compact_scan import CompactScan
from ...core.config import SgorConfig
from ...core.registration import Scan
from ...tracker import TrackerConfig
from ..config import MapperConfig
from ..edge import Edge
from ..keyframe import Keyframes
from .localisation import locate
from .merging import check_alike
from .merging import merge
from .merging import Merged
from .result import Located

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MapNode:
    """A scan of the map.

    Attributes
    ----------
    id : int
    stamp_ns : int
        Nanoseconds.
    session : int
        The drive that it came in by, counted from 0.
    T_map_sensor : (4, 4) float64
        Metres.
    """

    id: int
    stamp_ns: int
    session: int
    T_map_sensor: Array


@dataclass(frozen=True, eq=False, repr=False)
class Map:
    """What a drive leaves: `Mapper.map` gives it, `save` keeps it, `load` brings it back.

    It does not change; a `Mapper` that goes on in it, and `merge`, make new ones.

    Attributes
    ----------
    nodes : dict of int to MapNode
    edges : tuple of Edge
        Between nodes.
    keyframes : Keyframes
        Those nodes whose scans are kept.
    config : SgorConfig
        What it was made with, as are the next two.
    tracker_config : TrackerConfig
    mapper_config : MapperConfig
    T_base_sensor : (4, 4) float64 or None
        Mount of the sensor of the first scan on its vehicle, metres; None where nobody told.
        Exports lie in the frame of the base, whose z is up.
    warnings : tuple of str
        What is wrong with its folder and does no harm, in words.
    """

    nodes: dict[int, MapNode] = field(default_factory=dict)
    edges: tuple[Edge, ...] = ()
    keyframes: Keyframes = field(default_factory=Keyframes)
    config: SgorConfig = field(default_factory=SgorConfig)
    tracker_config: TrackerConfig = field(default_factory=TrackerConfig)
    mapper_config: MapperConfig = field(default_factory=MapperConfig)
    T_base_sensor: Array | None = None
    warnings: tuple[str, ...] = ()

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """Read a map that `save` wrote; scans are read when they are needed.

        Raises
        ------
        InputError
            No such folder, a file that is missing or damaged, or a map of another version.
        """
        from ...io.map_folder import read_map
        return cls(**read_map(folder))

    def save(self, folder: str | Path) -> None:
        """Write it to a folder, in place of a map that is there.

        It is written beside and exchanged at the end: whatever breaks it off leaves the old map
        or the new one.

        Raises
        ------
        InputError
            There is something else, or it cannot be written; or the map has no keyframes.
        """
        from ...io.map_folder import write_map
        write_map(folder, self)

    def locate(self, scan: Scan | ArrayLike, hint: ArrayLike | None = None) -> Located:
        """Find where in the map a scan was taken, without a guess.

        Parameters
        ----------
        scan : SemanticScan, PreparedScan or (N, 3) array
            Metres, in the frame of its sensor.
        hint : (4, 4) array, optional
            T_map_sensor as somebody believes it: keyframes near it are tried first. It may be
            wrong.

        Raises
        ------
        InputError
            No scan, one that was prepared with other settings than the map, or a hint that is no
            pose.
        """
        return locate(self, scan, hint)

    def merge(self, other: 'Map', executor: Executor | None = None) -> Merged:
        """Join another map of the same place to this one; neither of them changes.

        Parameters
        ----------
        other : Map
        executor : concurrent.futures.Executor, optional
            Where keyframes are located, in processes of its own; without it here.

        Raises
        ------
        InputError
            The maps were made with settings that do not go together.
        """
        return merge(self, other, executor)

    def scans(self, *, of_base: bool = False) -> Iterator[tuple[Array, CompactScan]]:
        """Yield T_map_sensor and scan of each keyframe, for the cloud or the grid of the map.

        With `of_base` the poses are seen from the base at the first scan, where the mount is
        known: z is up then, however the sensor is tilted.
        """
        frame = self.T_base_sensor if of_base and self.T_base_sensor is not None else np.eye(4)
        for keyframe in self.keyframes:
            yield frame @ self.nodes[keyframe.id].T_map_sensor, keyframe.scan

    @cached_property
    def positions(self) -> tuple[list[int], Array]:
        """The keyframes, and their positions (K, 3) in the map, metres."""
        nodes = [keyframe.id for keyframe in self.keyframes]
        return nodes, self.poses(nodes)[:, :3, 3]

    def poses(self, nodes: Iterable[int]) -> Array:
        """Return T_map_sensor of some nodes, (N, 4, 4)."""
        return np.array([self.nodes[node].T_map_sensor for node in nodes]).reshape(-1, 4, 4)

    def settings(self, config: SgorConfig | None, tracker_config: TrackerConfig | None,
                 mapper_config: MapperConfig | None
                 ) -> tuple[SgorConfig, TrackerConfig, MapperConfig]:
        """Return settings to go on with: those that are given, and its own for the rest.

        Raises
        ------
        InputError
            Scans prepared with them could not be registered to those of the map.
        """
        if config is not None:
            check_alike(SgorConfig.given(config), self.config, 'config', 'the map')
        return (config or self.config, tracker_config or self.tracker_config,
                mapper_config or self.mapper_config)

    @property
    def sessions(self) -> tuple[int, ...]:
        """The drives that it is made of."""
        return tuple(sorted({node.session for node in self.nodes.values()}))

    def __repr__(self) -> str:
        return (f'Map({len(self.nodes)} nodes, {len(self.keyframes)} keyframes, '
                f'{len(self.sessions)} sessions)')
