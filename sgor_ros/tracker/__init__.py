"""From pairwise registration to odometry, above `core` and without ROS.

`tracker` is the way of one scan. Beside it: `stamps` (which scans are late), `keyframes` (what a
scan can be registered to), `keyframe_selection` (which scans become one), `motion` (constant
velocity: where the next is expected), `choice` (which placement of a registration that motion
allows), `covariance` (how the errors of steps add up) and `result` (what comes of a scan). Places,
loops and a pose graph are neighbours of the tracker: they would read `Keyframe`s.
"""
from .config import TrackerConfig
from .result import State
from .result import TrackedScan
from .tracker import Tracker

__all__ = ['State', 'TrackedScan', 'Tracker', 'TrackerConfig']
