"""Which scans become keyframes: those far from the last one, or with little of it in view."""
import numpy as np
from numpy.typing import NDArray

from ..core.common import se3
from ..core.verdict.result import Registration
from .config import TrackerConfig
from .keyframes import Keyframe

Array = NDArray[np.float64]


def is_new_place(T_reference_sensor: Array, reference: Keyframe, last: Keyframe | None,
                 config: TrackerConfig) -> bool:
    """Return whether a scan is far from the newest keyframe that is remembered of its track.

    Parameters
    ----------
    T_reference_sensor : (4, 4) float64
        Where the scan is.
    reference : Keyframe
        What it was registered to; in consecutive mode that need not be remembered.
    last : Keyframe or None
    config : TrackerConfig
    """
    return last is None or _is_far(
        se3.inverse(last.T_odom_sensor) @ reference.T_odom_sensor @ T_reference_sensor, config)


def is_keyframe(T_reference_sensor: Array, found: Registration | None, reference: Keyframe,
                last: Keyframe | None, config: TrackerConfig) -> bool:
    """Return whether a scan is to be remembered; `found` tells its overlap with the reference."""
    if config.mode == 'consecutive':
        return is_new_place(T_reference_sensor, reference, last, config)
    first = reference.first_overlap
    return _is_far(T_reference_sensor, config) or (
        found is not None and first is not None
        and overlap(found) < config.keyframe_overlap * first)


def overlap(found: Registration) -> float:
    """Return the share of keypoints that lie on surfaces of the other scan; 0 without a pose."""
    return 0.0 if found.score is None else found.score.overlap


def _is_far(T: Array, config: TrackerConfig) -> bool:
    return (float(np.linalg.norm(T[:3, 3])) > config.keyframe_distance
            or se3.angle(T[:3, :3]) > config.keyframe_angle)
