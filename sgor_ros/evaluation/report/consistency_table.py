"""Consistency of trackers, by drive and mode: NEES, states, largest error."""
from collections.abc import Sequence

import numpy as np

from ...tracker import State
from ..metrics.consistency import METRES_WRONG
from ..metrics.consistency import ScanConsistency
from ..metrics.pose_error import NEES_BOUND
from ..sequences import Track
from .tables import markdown

RULE = ('Tracked, degenerate, failed and lost: states of the tracker; degenerate are predicted '
        'along some direction, failed and lost have no pose. '
        'Confirmed: predicted, and SGOR not asked. Drift: where a scan got no pose, the '
        'last one stands. NEES: squared error over what the covariance claims, mean (6 where it '
        f'is right, less is cautious) and share up to {NEES_BOUND:.1f} (chi-square of 6 '
        'dimensions, 99.73 %), of the step to the reference and of the pose since the start. '
        'Largest error: of a pose, beside the standard deviation that was claimed for it. Metres '
        f'wrong: scans off by over {METRES_WRONG:g} m and outside that bound.')
_GIVEN_UP = (State.FAILED, State.LOST)


def consistency_table(tracks: Sequence[Track]) -> str:
    """Return a line for each track of an odometry that claims a covariance."""
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
            _nees_cell([scan.step_nees for scan in scans]),
            _nees_cell([scan.pose_nees for scan in scans]),
            f'{worst.error_m:.2f}, {worst.claimed_m:.2f}' if worst else '-',
            str(metres_wrong(scans))]


def metres_wrong(scans: Sequence[ScanConsistency]) -> int:
    """Return how many poses are metres off without saying so."""
    return sum(scan.metres_wrong for scan in scans)


def _nees_cell(nees: Sequence[float]) -> str:
    """Return the mean and the share within the bound, of all that there are."""
    known = np.array([value for value in nees if not np.isnan(value)])
    return f'{known.mean():.1f}, {np.mean(known <= NEES_BOUND):.0%}' if len(known) else '-'
