"""What is registered to what: scans with known poses, right pairs and wrong pairs of them."""
from collections import defaultdict
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.scan.scan import SemanticScan
from ...io.datasets import Drive
from ...io.datasets import DriveScan
from ...io.datasets.semantickitti import frame
from ..methods import Matches

Array = NDArray[np.float64]

NO_OVERLAP_M = 100.0
"""Scans of one drive farther apart than this see different places."""

BAND_M = 10.0


@dataclass(frozen=True, eq=False)
class Pair:
    """Two scans to register, or matches of two. It can be sent to another process.

    Attributes
    ----------
    source, target : DriveScan or None
        None where there are matches only.
    T_target_source : (4, 4) float64 or None
        The truth; None where the scans are of different drives.
    right : bool
        Whether they see the same place, so that there is something to find.
    heights_known : bool
        Whether the truth is good in z.
    name : str
        Its own within a protocol; that of both scans where none is given.
    group : str
        What a protocol counts it under: a band of distance, a scene.
    matches : Matches or None
        Where they come from a file, in place of scans.
    """

    source: DriveScan | None
    target: DriveScan | None
    T_target_source: Array | None
    right: bool = True
    heights_known: bool = True
    name: str = ''
    group: str = ''
    matches: Matches | None = None

    def __post_init__(self) -> None:
        if not self.name:
            source, target = self.scans
            object.__setattr__(self, 'name', f'{source.name} {target.name}')

    @property
    def scans(self) -> tuple[DriveScan, DriveScan]:
        """Source and target of a pair of scans."""
        assert self.source is not None
        assert self.target is not None
        return self.source, self.target

    @property
    def data_set(self) -> str:
        """What it is counted under in tables."""
        return ' x '.join(sorted({scan.data_set for scan in self.scans}))

    @property
    def distance_m(self) -> float:
        """Distance of the sensors; NaN for different drives."""
        return (float('nan') if self.T_target_source is None
                else float(np.linalg.norm(self.T_target_source[:3, 3])))


def frame_in_memory(name: str, data_set: str, points: NDArray[np.float32],
                    labels: NDArray[np.uint32]) -> DriveScan:
    """Describe a scan in memory: points (N, 3), raw SemanticKITTI labels (N,)."""
    return DriveScan(name, data_set, 'semantickitti', partial(SemanticScan, points, labels))


def drive_of(name: str, scans: Iterable[tuple[NDArray[np.float32], NDArray[np.uint32], Array]]
             ) -> Drive:
    """Make a drive of scans in memory: points, raw SemanticKITTI labels, T_world_sensor."""
    frames, poses = [], []
    for index, (points, labels, T_world_sensor) in enumerate(scans):
        frames.append(frame_in_memory(f'{name}/{index:06d}', 'street', points, labels))
        poses.append(T_world_sensor)
    return Drive(name, frames, np.array(poses))


def near_pairs(drives: Sequence[Drive], max_distance_m: float) -> list[Pair]:
    """Return all pairs of scans of a drive up to a distance, the later scan as the source."""
    pairs = []
    for drive in drives:
        if drive.T_world_sensor is None:
            continue
        T = drive.T_world_sensor[:len(drive.scans)]
        for i, j in sorted(cKDTree(T[:, :3, 3]).query_pairs(max_distance_m)):
            pairs.append(Pair(drive.scans[j], drive.scans[i], se3.inverse(T[i]) @ T[j],
                              heights_known=drive.heights_known))
    return pairs


def listed_pairs(folder: Path, max_distance_m: float) -> list[Pair]:
    """Return the pairs of ``pairs.json``, each with each of its labels.

    Those of drives with poses are left out: they are found by their poses.
    """
    listing = folder / 'pairs.json'
    if not listing.is_file():
        return []
    pairs = []
    try:
        for entry in json.loads(listing.read_text()):
            if (folder / entry['source']).parents[1].joinpath('poses.txt').is_file():
                continue
            truth = np.array(entry['T_target_source'], np.float64)
            for source_labels in entry['source_labels']:
                for target_labels in entry['target_labels']:
                    source, target = (
                        frame(folder / scan, folder / labels, labels.removesuffix('.label'))
                        for scan, labels in ((entry['source'], source_labels),
                                             (entry['target'], target_labels)))
                    pairs.append(Pair(source, target, truth))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{listing}: expected source, target, their labels and T_target_source '
                         f'of each pair: {error!r}') from error
    return [pair for pair in pairs if pair.distance_m <= max_distance_m]


def choose(pairs: Sequence[Pair], count: int, seed: int) -> list[Pair]:
    """Choose up to `count` pairs at random, evenly over data sets and over bands of distance."""
    kinds = defaultdict(list)
    for pair in pairs:
        kinds[pair.distance_m // BAND_M, pair.data_set].append(pair)
    return _in_turns([kinds[kind] for kind in sorted(kinds)], count, seed)


def wrong_pairs(drives: Sequence[Drive], count: int, seed: int) -> list[Pair]:
    """Return up to `count` pairs of scans of different places, evenly over all pairs of drives.

    Scans of one drive count as different places where they are over `NO_OVERLAP_M` apart.
    """
    kinds = [[Pair(a, b, None, right=False) for a in one.scans for b in other.scans]
             for one, other in combinations(drives, 2)]
    kinds += [far for drive in drives if (far := list(_far_pairs(drive)))]
    return _in_turns(kinds, count, seed)


def _in_turns(kinds: Sequence[Sequence[Pair]], count: int, seed: int) -> list[Pair]:
    """Take one of each kind at a time, each in random order."""
    rng = np.random.default_rng(seed)
    shuffled = [[kind[i] for i in rng.permutation(len(kind))[:count]] for kind in kinds]
    turns = range(max(map(len, shuffled), default=0))
    return [kind[i] for i in turns for kind in shuffled if i < len(kind)][:count]


def _far_pairs(drive: Drive) -> Iterator[Pair]:
    if drive.T_world_sensor is None:
        return
    T = drive.T_world_sensor
    for i, j in combinations(range(len(drive.scans)), 2):
        if np.linalg.norm(T[i, :3, 3] - T[j, :3, 3]) > NO_OVERLAP_M:
            yield Pair(drive.scans[j], drive.scans[i], se3.inverse(T[i]) @ T[j], right=False,
                       heights_known=drive.heights_known)
