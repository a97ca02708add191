"""The settings of the tracker."""
from dataclasses import dataclass
import math
from typing import ClassVar

from ..core.common.settings import setting
from ..core.common.settings import Settings


@dataclass(frozen=True)
class TrackerAblation(Settings):
    """What only studies of the tracker change."""

    FOR_STUDIES: ClassVar[bool] = True

    predict_first: bool = setting(
        True, 'Test the motion so far on the clouds first: SGOR runs where that does not '
        'convince, and for each new keyframe. false: SGOR registers every scan')
    min_prediction_confidence: float = setting(
        0.85, 'A predicted motion is believed from this confidence on, or from min_confidence '
        'where that is higher; below, SGOR registers the scan',
        minimum=0.0, maximum=1.0)
    keyframe_overlap: float = setting(
        0.6, 'A scan whose keypoints lie on surfaces of its keyframe less often than this share '
        'of the first scan after it becomes the next', minimum=0.0, maximum=1.0)
    min_keypoints: int = setting(
        100, 'A scan with fewer keypoints becomes no keyframe', minimum=3, maximum=10000)
    retries: int = setting(
        2, 'Other keyframes to try for a scan that cannot be registered to its own', minimum=0,
        maximum=100)
    turn_acceleration: float = setting(
        2.0, 'Standard deviation of the acceleration of turns', 'rad/s^2', minimum=0.001,
        maximum=1000.0)
    jump_back: float = setting(
        1.0, 'Stamps that fall back by more, two in a row, begin a new track; scans that are '
        'late by less are dropped', 's', minimum=0.0, maximum=1e6)
    max_late: int = setting(
        10, 'So many late scans in a row begin a new track too', minimum=2, maximum=10000)


@dataclass(frozen=True)
class TrackerConfig(TrackerAblation):
    """Which scan each scan is registered to, which motions are possible, and when a track ends."""

    mode: str = setting(
        'keyframe', 'Register to the scan before, or to the last keyframe',
        choices=('consecutive', 'keyframe'), group='keyframes', common=True)
    keyframe_distance: float = setting(
        5.0, 'A scan farther from its keyframe becomes the next', 'm', minimum=0.1, maximum=100.0,
        group='keyframes')
    keyframe_angle: float = setting(
        math.radians(20.0), 'A scan turned by more from its keyframe becomes the next', 'rad',
        minimum=0.01, maximum=math.pi, group='keyframes')
    max_keyframes: int = setting(
        10, 'Keyframes to remember; where there are more, the one goes that leaves the '
        'smallest gap', minimum=3, maximum=1000, group='keyframes')

    max_speed: float = setting(
        60.0, 'Faster motions are refused', 'm/s', minimum=0.01, maximum=1000.0, group='motion')
    max_turn_rate: float = setting(
        12.0, 'Faster turns are refused', 'rad/s', minimum=0.01, maximum=1000.0, group='motion')
    acceleration: float = setting(
        3.0, 'Standard deviation of the acceleration, for the prediction that chooses among '
        'placements and bridges degenerate directions', 'm/s^2', minimum=0.001, maximum=1000.0,
        group='motion')

    max_failures: int = setting(
        5, 'After so many failures in a row the track is lost', minimum=1, maximum=1000,
        group='lost')
    new_track_after: float = setting(
        5.0, 'Lost and without a pose for longer, a new track begins', 's', minimum=0.0,
        maximum=1e6, group='lost')
