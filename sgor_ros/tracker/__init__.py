"""From pairwise registration to odometry, above `core` and without ROS.

`tracker` is the way of one scan on one screen. Beside it: `stamps` (which scans are late),
`keyframes` (what a scan can be registered to), `motion` (where it is expected), `choice` (what a
registration says in that light), `covariance` (how doubt adds up) and `result` (the way out).
Places, loops and a pose graph are neighbours of the tracker: they would read `Keyframe`s.
"""
from .config import TrackerConfig
from .result import State
from .result import TrackedScan
from .tracker import Tracker

__all__ = ['State', 'TrackedScan', 'Tracker', 'TrackerConfig']
