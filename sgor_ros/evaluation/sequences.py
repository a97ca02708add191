"""Runs odometries over the same scans, scan by scan in turns."""
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
import time

import numpy as np
from numpy.typing import NDArray

from ..core.config import SgorConfig
from ..core.warmup import warm_up
from ..io.datasets import Drive
from ..io.terminal import progress
from .methods.odometries import Step
from .methods.odometries import TrackerOdometry
from .metrics.consistency import ScanConsistency
from .metrics.consistency import track_consistency
from .metrics.trajectory import KITTI_LENGTHS_M
from .metrics.trajectory import track_errors
from .metrics.trajectory import TrackErrors

Array = NDArray[np.float64]

SETTLED = 3
"""Scans at the start whose time does not count: caches and local maps fill."""


@dataclass(frozen=True, eq=False)
class Track:
    """What one odometry made of one drive.

    Attributes
    ----------
    method, drive : str
    errors : TrackErrors
        Where a scan got no pose, the last one stands.
    truth : (N, 4, 4) float64
        T_world_sensor.
    lengths_m : tuple of float
        Stretches that the drift was measured over.
    without_pose : int
    seconds : (N,) float64
    cpu_seconds : (N,) float64
        Of all threads together: what the clock shows depends on who else wants the cores.
    consistency : list of ScanConsistency
        For each scan; empty where the odometry gives nothing but poses.
    """

    method: str
    drive: str
    errors: TrackErrors
    truth: Array
    lengths_m: tuple[float, ...]
    without_pose: int
    seconds: Array
    cpu_seconds: Array
    consistency: list[ScanConsistency]


def run_drive(drive: Drive, makers: dict[str, Callable[[], Step]], config: SgorConfig
              ) -> list[Track]:
    """Track a drive that has true poses by each odometry."""
    assert drive.T_world_sensor is not None
    truth = drive.T_world_sensor[:len(drive.scans)]
    warm_up(config)
    for make in makers.values():
        step = make()
        for frame in drive.scans[:2]:
            step(frame.read())
    odometry = {name: make() for name, make in makers.items()}
    poses: dict[str, list[Array | None]] = {name: [] for name in makers}
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in makers}
    rng = np.random.default_rng(0)
    with progress(drive.name, len(drive.scans), 'scan') as told:
        for frame in told.over(drive.scans):
            scan = frame.read()
            for name in rng.permutation(list(makers)):
                start, cpu_start = time.perf_counter(), time.process_time()
                T = odometry[name](scan)
                seconds[name].append((time.perf_counter() - start,
                                      time.process_time() - cpu_start))
                poses[name].append(T)
    return [_track(name, drive.name, poses[name], truth, seconds[name], odometry[name])
            for name in makers]


def _track(method: str, drive: str, poses: Sequence[Array | None], truth: Array,
           seconds: Sequence[tuple[float, float]], odometry: Step) -> Track:
    held: list[Array] = []
    for T in poses:
        held.append(T if T is not None else held[-1] if held else np.eye(4))
    way = float(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1).sum())
    # those of the KITTI benchmark, shrunk to a drive that is shorter than theirs
    shrink = min(1.0, way / 1000)
    lengths = tuple(round(length * shrink, 2) for length in KITTI_LENGTHS_M)
    clock, processor = np.array(seconds).T
    return Track(method, drive, track_errors(np.array(held), truth, lengths), truth, lengths,
                 sum(T is None for T in poses), clock, processor,
                 track_consistency(odometry.tracked, truth)
                 if isinstance(odometry, TrackerOdometry) else [])
