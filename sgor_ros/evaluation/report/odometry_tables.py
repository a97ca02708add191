"""Tables of odometries: drift, RPE and times; states and NEES of the tracker."""
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import fields
from typing import Any

import numpy as np

from ...tracker import State
from ..metrics.consistency import LARGE_ERROR_M
from ..metrics.consistency import NEES_BOUND
from ..metrics.consistency import ScanConsistency
from ..odometry import SETTLED
from ..odometry import Track
from .cells import markdown
from .cells import times

RULE = ('Tracked, degenerate, failed and lost: states of the tracker; degenerate are predicted '
        'along some direction, failed and lost have no pose. '
        'Confirmed: predicted, and SGOR not asked. Drift: where a scan got no pose, the '
        'last one stands. NEES: squared error over what the covariance claims, mean (6 where it '
        f'is right, less is cautious) and share up to {NEES_BOUND:.1f} (chi-square of 6 '
        'dimensions, 99.73 %), of the step to the reference and of the pose since the start. '
        'Largest error: of a pose, beside the standard deviation that was claimed for it. Metres '
        f'wrong: scans off by over {LARGE_ERROR_M:g} m and outside that bound.')
_GIVEN_UP = (State.FAILED, State.LOST)
_CONSISTENCY = [field.name for field in fields(ScanConsistency)]


def sequence_table(tracks: Sequence[Track]) -> str:
    """Return drift, errors from scan to scan and times."""
    lines = []
    for track in tracks:
        found = track.errors
        lines.append([
            f'{track.drive}: {track.method}', f'{len(track.truth)}', f'{found.length_m:.0f}',
            f'{track.lengths_m[0]:g}-{track.lengths_m[-1]:g}',
            f'{found.drift.translation_percent:.2f}', f'{found.drift.rotation_deg_per_m:.4f}',
            f'{100 * np.median(found.rpe_translation_m):.1f}',
            f'{np.median(found.rpe_rotation_deg):.3f}',
            str(track.without_pose), times(track.seconds[SETTLED:]),
            times(track.cpu_seconds[SETTLED:])])
    return markdown(['drive: method', 'scans', 'way [m]', 'stretches [m]', 'drift [%]',
                     'drift [deg/m]', 'TE of a step [cm]', 'RE of a step [deg]',
                     'without a pose', 'time a scan [ms]', 'CPU time a scan [ms]'], lines)


def scan_records(tracks: Sequence[Track]) -> list[dict[str, Any]]:
    """Return a line a scan: error of the pose and time, and the consistency of the tracker."""
    return [{'drive': track.drive, 'method': track.method, 'scan': scan,
             'off_the_truth_m': float(error), 'seconds': seconds, 'cpu_seconds': cpu,
             **(asdict(track.consistency[scan]) if track.consistency
                else dict.fromkeys(_CONSISTENCY, ''))}
            for track in tracks for scan, (error, seconds, cpu) in enumerate(zip(
                track.errors.ape_translation_m, track.seconds, track.cpu_seconds, strict=True))]


def consistency_table(tracks: Sequence[Track]) -> str:
    """Return a line for each track of an odometry that has covariances."""
    return markdown(
        ['drive: method', 'scans', 'tracked', 'degenerate', 'failed', 'lost', 'confirmed',
         'drift [%]', 'NEES of a step', 'NEES of a pose', 'largest error, claimed [m]',
         'metres wrong'],
        [_line(track) for track in tracks if track.consistency])


def _line(track: Track) -> list[str]:
    """Return the line of a track."""
    scans = track.consistency[1:]    # the first scan is where it is by definition
    states = np.array([scan.state for scan in scans])
    shares = [f'{np.mean(states == state):.0%}'
              for state in (State.TRACKING, State.DEGENERATE, *_GIVEN_UP)]
    with_pose = [scan for scan in scans if np.isfinite(scan.error_m)]
    worst = max(with_pose, key=lambda scan: scan.error_m, default=None)
    return [f'{track.drive}: {track.method}', str(len(track.consistency)), *shares,
            f'{np.mean([scan.confirmed for scan in scans]):.0%}' if scans else '-',
            f'{track.errors.drift.translation_percent:.2f}',
            _nees([scan.step_nees for scan in scans]),
            _nees([scan.pose_nees for scan in scans]),
            f'{worst.error_m:.2f}, {worst.claimed_m:.2f}' if worst else '-',
            str(sum(scan.inconsistent for scan in scans))]


def _nees(nees: Sequence[float]) -> str:
    """Return the mean and the share within the bound, of all that there are."""
    known = np.array([value for value in nees if not np.isnan(value)])
    return f'{known.mean():.1f}, {np.mean(known <= NEES_BOUND):.0%}' if len(known) else '-'
