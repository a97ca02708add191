"""Odometries, scan by scan: the tracker, KISS-ICP, GICP of small_gicp from scan to scan.

A new one: a function that returns a step (scan in, T_odom_sensor out), and a line in `odometries`.
"""
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ...core.scan.scan import SemanticScan
from ...tracker import TrackedScan
from ...tracker import Tracker
from ...tracker import TrackerConfig
from . import installed

Array = NDArray[np.float64]
Points = NDArray[np.float32]

PERIOD_NS = 100_000_000

Step = Callable[[SemanticScan], Array | None]


def trackers(config: SgorConfig, *, unlabelled: bool) -> dict[str, Callable[[], Step]]:
    """Return what makes the tracker, by the name of its mode; also without labels if asked."""
    return {f'SGOR, {mode}{"" if labels else ", no labels"}':
            partial(TrackerOdometry, config, mode, labels)
            for labels in (True, False)[:1 + unlabelled] for mode in ('consecutive', 'keyframe')}


def odometries(config: SgorConfig, say: Callable[[str], None], *, unlabelled: bool = False
               ) -> dict[str, Callable[[], Step]]:
    """Return what makes each odometry, by name; others where they are installed."""
    makers = trackers(config, unlabelled=unlabelled)
    if installed('kiss_icp', say):
        makers['KISS-ICP'] = lambda: _unlabelled(kiss_icp())
    if installed('small_gicp', say):
        makers['small_gicp, scan to scan'] = lambda: _unlabelled(scan_to_scan(config.threads))
    return makers


class TrackerOdometry:
    """The tracker, and its answer to each scan."""

    def __init__(self, config: SgorConfig, mode: str, labels: bool) -> None:
        self._tracker = Tracker(config, TrackerConfig(mode=mode))
        self._labels = labels
        self.tracked: list[TrackedScan] = []

    def __call__(self, scan: SemanticScan) -> Array | None:
        """Track a scan and return T_odom_sensor, if it has a pose."""
        # built anew, as a raw scan has to be
        labels = scan.labels if self._labels else np.zeros_like(scan.labels)
        result = self._tracker.track(SemanticScan(scan.points, labels),
                                     (len(self.tracked) + 1) * PERIOD_NS)
        self.tracked.append(replace(result, registration=None))
        return result.T_odom_sensor


def _unlabelled(take: Callable[[NDArray[np.float32]], Array]) -> Step:
    return lambda scan: take(scan.points)


def kiss_icp() -> Callable[[Points], Array]:
    """Return KISS-ICP in its default settings: takes a scan, returns T_odom_sensor."""
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP
    odometry = KissICP(load_config(None))
    no_stamps = np.empty(0)    # these scans have none a point, so there is nothing to deskew

    def step(points: Points) -> Array:
        odometry.register_frame(points.astype(np.float64), no_stamps)
        return np.array(odometry.last_pose)

    return step


def scan_to_scan(threads: int) -> Callable[[Points], Array]:
    """Return GICP of small_gicp between consecutive scans: takes a scan, returns T_odom_sensor.

    Its default settings; the motion of the last step is the guess for the next.
    """
    import small_gicp
    pose, step_before = np.eye(4), np.eye(4)
    last: Any = None

    def step(points: Points) -> Array:
        nonlocal pose, step_before, last
        cloud, tree = small_gicp.preprocess_points(points.astype(np.float64), num_threads=threads)
        if last is not None:
            found = small_gicp.align(last[0], cloud, last[1], init_T_target_source=step_before,
                                     num_threads=threads)
            step_before = np.array(found.T_target_source)
            pose = pose @ step_before
        last = cloud, tree
        return pose

    return step
