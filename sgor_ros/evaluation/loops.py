"""Runs the mapper over drives that come back to places, and judges its loops by the truth.

Others that close loops run over the same scans.
"""
from collections.abc import Callable
from dataclasses import dataclass
import time

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..core.common import se3
from ..core.config import SgorConfig
from ..io.datasets import Drive
from ..io.terminal import progress
from ..mapping import Loop
from ..mapping import Mapper
from ..mapping import MapperConfig
from ..mapping.edge import Kind
from .methods.loop_closing import LoopCloser
from .metrics.pose_error import nees
from .metrics.pose_error import rotation_error_deg
from .metrics.pose_error import translation_error_m
from .metrics.trajectory import ape
from .metrics.trajectory import rmse
from .metrics.trajectory import travelled_m

Array = NDArray[np.float64]

WRONG_M, WRONG_DEG = 0.6, 5.0
"""A loop that is off by more is wrong."""
REVISIT_M = 20.0
"""A keyframe so near to an earlier one is a revisit, if"""
ROUND_ABOUT_M = 60.0
"""the way between them is longer by this than their distance."""


@dataclass(frozen=True, eq=False)
class LoopRun:
    """What the mapper made of one drive.

    Attributes
    ----------
    drive : str
    scans, with_pose, nodes, keyframes, parts : int
    megabytes : float
        Of all keyframes.
    revisits, closed : int
        Nodes at places that were seen before, and those of them that are the source of a right
        loop.
    loops : list of Loop
    error_m, error_deg, nees : (L,) float64
        Of each loop.
    odometry_nees : (E,) float64
        Of each odometry edge of the graph.
    wrong : int
    ape_before_m, ape_after_m : float
        Root of the mean square, from the first scan on, of the poses that are joined to it.
    chi_squared, freedom : float, int
    cpu_seconds : float
        Of all, tracking included.
    mapper : Mapper
    """

    drive: str
    scans: int
    with_pose: int
    nodes: int
    keyframes: int
    parts: int
    megabytes: float
    revisits: int
    closed: int
    loops: list[Loop]
    error_m: Array
    error_deg: Array
    nees: Array
    odometry_nees: Array
    wrong: int
    ape_before_m: float
    ape_after_m: float
    chi_squared: float
    freedom: int
    cpu_seconds: float
    mapper: Mapper


@dataclass(frozen=True, eq=False)
class OtherRun:
    """What another method made of the same drive.

    Attributes
    ----------
    method, drive : str
    scans, revisits : int
        As the mapper has them.
    closed : int
        Revisits whose scan lies in a local map from which a right loop was closed.
    error_m, error_deg : (L,) float64
        Of each loop.
    wrong : int
    cpu_seconds : float
        Of all, its odometry included.
    """

    method: str
    drive: str
    scans: int
    revisits: int
    closed: int
    error_m: Array
    error_deg: Array
    wrong: int
    cpu_seconds: float


def run_loops(drive: Drive, config: SgorConfig, mapper_config: MapperConfig | None = None
              ) -> LoopRun:
    """Map a drive that has true poses."""
    assert drive.T_world_sensor is not None
    begin = time.process_time()
    mapper = Mapper(config, None, mapper_config)
    loops: list[Loop] = []
    stamps_ns = [scan.stamp_ns for scan in drive]
    with progress(drive.name, len(drive), 'scan') as told:
        for scan in told.over(drive):
            loops += mapper.track(scan.read(), scan.stamp_ns).loops
    loops += mapper.finish()
    seconds = time.process_time() - begin
    truth = dict(zip(stamps_ns, drive.T_world_sensor, strict=True))
    true = [se3.inverse(truth[loop.target_stamp_ns]) @ truth[loop.source_stamp_ns]
            for loop in loops]
    pairs = [(loop.T_target_source, T) for loop, T in zip(loops, true, strict=True)]
    metres, degrees, wrong = _judged(pairs)
    closed = {loop.source_stamp_ns for loop, is_wrong in zip(loops, wrong, strict=True)
              if not is_wrong}
    revisits = _revisits(mapper, drive)
    before, after = (_ape(mapper, truth, loops=with_loops) for with_loops in (False, True))
    chi_squared, freedom = mapper.graph.chi_squared()
    return LoopRun(
        drive.name, len(drive), len(mapper.trajectory().stamps_ns), len(mapper.graph),
        len(mapper.keyframes), len(set(mapper.trajectory().part.tolist())),
        mapper.keyframes.nbytes / 1e6, len(revisits),
        len(revisits & closed), loops, metres, degrees,
        np.array([nees(loop.T_target_source, T, loop.covariance)
                  for loop, T in zip(loops, true, strict=True)]), _odometry_nees(mapper, truth),
        int(wrong.sum()), before, after, chi_squared, freedom, seconds, mapper)


def run_other(method: str, make: Callable[[], LoopCloser], drive: Drive, mapper: Mapper
              ) -> OtherRun:
    """Close loops by another method on a drive that the mapper was on."""
    true = drive.T_world_sensor
    assert true is not None
    begin = time.process_time()
    closer = make()
    found = []
    with progress(f'{drive.name}: {method}', len(drive), 'scan') as told:
        for scan in told.over(drive):
            found += closer(scan.read().points)
    found += closer.finish()
    seconds = time.process_time() - begin
    pairs = [(loop.T_target_source, se3.inverse(true[loop.target]) @ true[loop.source])
             for loop in found]
    metres, degrees, wrong = _judged(pairs)
    stamps_ns = [scan.stamp_ns for scan in drive]
    revisits = _revisits(mapper, drive)
    closed = {stamps_ns[i] for loop, is_wrong in zip(found, wrong, strict=True) if not is_wrong
              for i in loop.scans}
    return OtherRun(method, drive.name, len(drive), len(revisits), len(revisits & closed), metres,
                    degrees, int(wrong.sum()), seconds)


def _judged(pairs: list[tuple[Array, Array]]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the errors of loops, found and true, in metres and degrees; and which are wrong."""
    metres = np.array([translation_error_m(*pair) for pair in pairs])
    degrees = np.array([rotation_error_deg(*pair) for pair in pairs])
    return metres, degrees, (metres > WRONG_M) | (degrees > WRONG_DEG)


def _revisits(mapper: Mapper, drive: Drive) -> set[int]:
    """Return the stamps of nodes at a place where an earlier node was, much earlier on the way."""
    true = drive.T_world_sensor
    assert true is not None
    row = {scan.stamp_ns: i for i, scan in enumerate(drive)}
    stamps_ns = list(mapper.node_stamps_ns().values())
    positions = true[[row[stamp] for stamp in stamps_ns], :3, 3]
    travelled = travelled_m(true)
    way = {stamp: travelled[row[stamp]] for stamp in stamps_ns}
    found = set()
    for i, j in cKDTree(positions).query_pairs(REVISIT_M):
        a, b = stamps_ns[i], stamps_ns[j]
        if abs(way[a] - way[b]) > ROUND_ABOUT_M + np.linalg.norm(positions[i] - positions[j]):
            found.add(max(a, b))
    return found


def _odometry_nees(mapper: Mapper, truth: dict[int, Array]) -> Array:
    stamp_of = mapper.node_stamps_ns()
    return np.array([
        nees(edge.T_target_source, se3.inverse(truth[stamp_of[edge.target]])
             @ truth[stamp_of[edge.source]], edge.covariance)
        for edge in mapper.graph.edges if edge.kind is Kind.ODOMETRY])


def _ape(mapper: Mapper, truth: dict[int, Array], *, loops: bool) -> float:
    found = mapper.trajectory(loops=loops)
    joined = found.part == found.part[0]
    stamps_ns = found.stamps_ns[joined].tolist()
    origin = se3.inverse(truth[stamps_ns[0]])
    _, metres = ape(found.T_map_sensor[joined], [origin @ truth[stamp] for stamp in stamps_ns])
    return rmse(metres)
