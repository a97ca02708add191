"""Runs odometries over the same scans, scan by scan in turns."""
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from importlib.util import find_spec
import time

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ..core.config import SgorConfig
from ..core.scan.scan import SemanticScan
from ..core.warmup import warm_up
from ..io.datasets import Drive
from ..tracker import TrackedScan
from ..tracker import Tracker
from ..tracker import TrackerConfig
from .honesty import Said
from .honesty import what_was_said
from .metrics import KITTI_LENGTHS_M
from .rivals import kiss_icp
from .rivals import scan_to_scan
from .track import track_errors
from .track import TrackErrors

Array = NDArray[np.float64]

PERIOD_NS = 100_000_000
SETTLED = 3
"""Scans at the start whose time does not count: caches and local maps fill."""

Step = Callable[[SemanticScan], Array | None]


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
    said : list of Said
        For each scan; empty where the odometry says nothing but poses.
    """

    method: str
    drive: str
    errors: TrackErrors
    truth: Array
    lengths_m: tuple[float, ...]
    without_pose: int
    seconds: Array
    said: list[Said]


def trackers(config: SgorConfig, *, unlabelled: bool) -> dict[str, Callable[[], Step]]:
    """Return what makes the tracker, by the name of its mode; also without labels if asked."""
    return {f'SGOR, {mode}{"" if labels else ", no labels"}':
            lambda mode=mode, labels=labels: _Sgor(config, mode, labels)    # type: ignore[misc]
            for labels in (True, False)[:1 + unlabelled] for mode in ('consecutive', 'keyframe')}


def odometries(config: SgorConfig, say: Callable[[str], None], *, unlabelled: bool = False
               ) -> dict[str, Callable[[], Step]]:
    """Return what makes each odometry, by name; rivals where they are installed."""
    makers = trackers(config, unlabelled=unlabelled)
    if find_spec('kiss_icp') is None:
        say('kiss_icp is not installed, so left out; to have it: pip install kiss-icp')
    else:
        makers['KISS-ICP'] = lambda: _unlabelled(kiss_icp())
    makers['small_gicp, scan to scan'] = lambda: _unlabelled(scan_to_scan(config.threads))
    return makers


class _Sgor:
    """The tracker, and what it said of each scan."""

    def __init__(self, config: SgorConfig, mode: str, labels: bool) -> None:
        self._tracker = Tracker(config, TrackerConfig(mode=mode))
        self._labels = labels
        self.tracked: list[TrackedScan] = []

    def __call__(self, scan: SemanticScan) -> Array | None:
        # built anew, as a raw scan has to be
        labels = scan.labels if self._labels else np.zeros_like(scan.labels)
        result = self._tracker.track(SemanticScan(scan.points, labels),
                                     (len(self.tracked) + 1) * PERIOD_NS)
        self.tracked.append(replace(result, registration=None))
        return result.T_odom_sensor


def _unlabelled(take: Callable[[NDArray[np.float32]], Array]) -> Step:
    return lambda scan: take(scan.points)


def run_drive(drive: Drive, makers: dict[str, Callable[[], Step]], config: SgorConfig
              ) -> list[Track]:
    """Track a drive that has true poses by each odometry."""
    assert drive.T_world_sensor is not None
    truth = drive.T_world_sensor[:len(drive.frames)]
    warm_up(config)
    for make in makers.values():
        step = make()
        for frame in drive.frames[:2]:
            step(frame.read())
    odometry = {name: make() for name, make in makers.items()}
    poses: dict[str, list[Array | None]] = {name: [] for name in makers}
    seconds: dict[str, list[float]] = {name: [] for name in makers}
    rng = np.random.default_rng(0)
    for frame in tqdm(drive.frames, drive.name, unit='scan', disable=None):
        scan = frame.read()
        for name in rng.permutation(list(makers)):
            start = time.perf_counter()
            T = odometry[name](scan)
            seconds[name].append(time.perf_counter() - start)
            poses[name].append(T)
    return [_track(name, drive.name, poses[name], truth, seconds[name], odometry[name])
            for name in makers]


def _track(method: str, drive: str, poses: Sequence[Array | None], truth: Array,
           seconds: Iterable[float], odometry: Step) -> Track:
    held: list[Array] = []
    for T in poses:
        held.append(T if T is not None else held[-1] if held else np.eye(4))
    way = float(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1).sum())
    # those of the KITTI benchmark, shrunk to a drive that is shorter than theirs
    shrink = min(1.0, way / 1000)
    lengths = tuple(round(length * shrink, 2) for length in KITTI_LENGTHS_M)
    return Track(method, drive, track_errors(np.array(held), truth, lengths), truth, lengths,
                 sum(T is None for T in poses), np.array(list(seconds)),
                 what_was_said(odometry.tracked, truth) if isinstance(odometry, _Sgor) else [])
