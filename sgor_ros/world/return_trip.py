"""A drive that turns round at its end and comes back the other way."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def there_and_back(poses: Array, left: float = 0.0, turn: int = 20) -> Array:
    """Return a drive, a turn by half at its end, and the same way back.

    Parameters
    ----------
    poses : (N, 4, 4) array
        T_world_sensor of the way there, x ahead, translations in m.
    left : float
        How far to its left the way back runs, m: the width of a lane.
    turn : int
        Number of poses of the turn.

    Returns
    -------
    (2 N + turn, 4, 4) array
        T_world_sensor; the way back faces where it goes.
    """
    parts = np.arange(1, turn + 1) / (turn + 1)
    turning = [poses[-1] @ _aside(left * part, np.pi * part) for part in parts]
    return np.concatenate([poses, np.reshape(turning, (-1, 4, 4)),
                           poses[::-1] @ _aside(left, np.pi)])


def _aside(left: float, yaw: float) -> Array:
    """Return a pose so far to the left of another, m, and turned to the left, rad."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, 0], [s, c, 0, left], [0, 0, 1, 0], [0, 0, 0, 1.0]])
