"""The table of what trackers said and what was true, by drive and mode."""
from collections.abc import Sequence

import numpy as np

from ..tracker import State
from .honesty import METRES_WRONG
from .honesty import Said
from .metrics import THREE_SIGMA
from .report import markdown
from .sequences import Track

RULE = ('Tracked, degenerate, failed and lost: states of the tracker; degenerate are predicted '
        'along some direction, failed and lost have no pose. '
        'Confirmed: predicted, and SGOR not asked. Drift: where a scan got no pose, the '
        'last one stands. NEES: squared error over what the covariance claims, mean (6 where it '
        f'is right, less is cautious) and share up to {THREE_SIGMA:.1f} (chi-square of 6 '
        'dimensions, 99.73 %), of the step to the reference and of the pose since the start. '
        'Largest error: of a pose, beside the standard deviation that was claimed for it. Metres '
        f'wrong: scans off by over {METRES_WRONG:g} m and outside that bound.')
_GIVEN_UP = (State.FAILED, State.LOST)


def honesty_table(tracks: Sequence[Track]) -> str:
    """Return a line for each track of an odometry that says how sure it is."""
    return markdown(
        ['drive: method', 'scans', 'tracked', 'degenerate', 'failed', 'lost', 'confirmed',
         'drift [%]', 'NEES of a step', 'NEES of a pose', 'largest error, claimed [m]',
         'metres wrong'],
        [_line(track) for track in tracks if track.said])


def _line(track: Track) -> list[str]:
    """Return the line of a track."""
    said = track.said[1:]    # the first scan is where it is by definition
    states = np.array([scan.state for scan in said])
    shares = [f'{np.mean(states == state):.0%}'
              for state in (State.TRACKING, State.DEGENERATE, *_GIVEN_UP)]
    with_pose = [scan for scan in said if np.isfinite(scan.error_m)]
    worst = max(with_pose, key=lambda scan: scan.error_m, default=None)
    return [f'{track.drive}: {track.method}', str(len(track.said)), *shares,
            f'{np.mean([scan.confirmed for scan in said]):.0%}' if said else '-',
            f'{track.errors.drift.translation_percent:.2f}',
            _honesty([scan.step_nees for scan in said]),
            _honesty([scan.pose_nees for scan in said]),
            f'{worst.error_m:.2f}, {worst.claimed_m:.2f}' if worst else '-',
            str(metres_wrong(said))]


def metres_wrong(said: Sequence[Said]) -> int:
    """Return how many poses are metres off without saying so."""
    return sum(scan.metres_wrong for scan in said)


def _honesty(nees: Sequence[float]) -> str:
    """Return the mean and the share within the bound, of all that there are."""
    known = np.array([value for value in nees if not np.isnan(value)])
    return f'{known.mean():.1f}, {np.mean(known <= THREE_SIGMA):.0%}' if len(known) else '-'
