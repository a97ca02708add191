"""From pairwise registration to odometry, above `core` and without ROS.

`tracker` is the way of one scan: `stamps` (is it late?), `deskewing`, `scan_registration` (the
step from a keyframe to it, predicted or registered) and `track` (what is known from scan to scan,
and how each changes it). What these use: `scan_at_work` (what a scan has become so far),
`keyframes` (what a scan can be registered to), `keyframe_selection` (which scans become one),
`motion` (constant velocity: where the next is expected), `choice` (which placement of a
registration that motion allows), `covariance` (how the errors of steps add up) and `result` (what
comes of a scan).
"""
from .config import TrackerConfig
from .result import State
from .result import TrackedScan
from .tracker import Tracker

__all__ = ['State', 'TrackedScan', 'Tracker', 'TrackerConfig']
