"""Perturbation test: a pose is pushed along a weak direction, fitted again, and scored once more.

The direction is degenerate where ICP does not bring the pose back and its score does not rule it
out. How far it can be pushed is how little is known.
"""
import numpy as np
from numpy.typing import NDArray

from ..common import se3
from ..icp.point_to_plane import icp
from ..index.scan_index import ScanIndex
from ..scoring.comparison import differ
from ..scoring.comparison import ruled_out
from ..scoring.pose_scoring import score_keypoints
from .directions import DegenerateDirection
from .directions import is_shift
from .directions import perturbed_poses

Array = NDArray[np.float64]

PUSH, LONGER_PUSHES = 2.0, (4.0, 16.0)
"""How far a weak direction is tried, in maximum correspondence distances: the first decides, the
others tell how far it goes on, and where to."""
KEPT_SHARE = 0.8
"""A direction is degenerate where a push along it is kept to this share: elsewhere the clouds
slide back."""


def pushes_along(weak: Array, target: ScanIndex) -> Array:
    """Return the twists to try for (K, 6) weak directions: all forth, then all back, (2 K, 6)."""
    return PUSH * target.max_distance * np.vstack((weak, -weak))


def is_degenerate(poses: Array, stands: NDArray[np.bool_], push: Array) -> bool:
    """Return whether a pose that was pushed both ways stays where it came to.

    Parameters
    ----------
    poses : (3, 4, 4) float64
        The pose, and what became of it pushed forth and back.
    stands : (2,) bool
        Which of the two are other poses that nothing rules out.
    push : (6,) float64
        The twist it was pushed by.
    """
    if is_shift(push / np.linalg.norm(push)):
        came = np.linalg.norm(poses[1:, :3, 3] - poses[0, :3, 3], axis=1)
        wanted = np.linalg.norm(push[:3])
    else:
        came = np.linalg.norm(se3.rotation_vectors(
            poses[1:, :3, :3] @ poses[0, :3, :3].T), axis=1)
        wanted = np.linalg.norm(push[3:])
    return bool(stands.any() and came.mean() > KEPT_SHARE * wanted)


def measured(source: ScanIndex, target: ScanIndex, T: Array, outcomes: NDArray[np.int8],
             twist: Array, lever: float, radius: float, rounds: tuple[int, int], keypoints: int
             ) -> DegenerateDirection:
    """Find out how far, and where to, the clouds can be pushed along a degenerate direction.

    Parameters
    ----------
    T : (4, 4) float64
        The pose, T_target_source.
    outcomes : (n,) int8
        Of `score_keypoints` for it, with as many `keypoints`.
    twist : (6,) float64
        The weak direction, by one metre.
    lever : float
        Typical distance of the points from the sensor, metres.
    radius : float
        Half of what is unknown where there is no end in sight, metres.
    rounds : (int, int)
        Of `icp`.
    """
    ways = target.max_distance * np.array(
        [way for length in LONGER_PUSHES for way in (length, -length)])
    tried = icp(source, target, perturbed_poses(T, np.outer(ways, twist)), *rounds)
    found = score_keypoints(source, target, tried, keypoints)
    standing = differ(T, tried, target) & ~ruled_out(outcomes, found)
    if not standing[:2].any():
        return DegenerateDirection(twist, LONGER_PUSHES[0] * target.max_distance, lever)
    if is_shift(twist):
        # the line through the places where it stands is straighter than the eigenvector
        places = np.vstack((T[:3, 3], tried[standing, :3, 3]))
        line = np.linalg.svd(places - places.mean(axis=0))[2][0]
        if target.level:
            # nor does it leave the ground, of which the keypoints are none
            line -= (line @ target.axes[2]) * target.axes[2]
        twist = np.concatenate((line / np.linalg.norm(line), np.zeros(3)))
    # with no end in sight the source may be anywhere around the target, wherever it is laid now
    offset = float(T[:3, 3] @ twist[:3])
    return DegenerateDirection(twist, float(np.hypot(radius / np.sqrt(3), offset)), lever)
