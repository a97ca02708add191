"""Loops and a pose graph on top of the tracker, without ROS and without files.

`mapper` is the way of one scan. Beside it: `session` (one drive, in a map of before or a new one),
`odometry` and `scan_poses` (nodes and edges out of tracked scans, and the pose of each scan),
`keyframe` (what is kept of a scan), `retrieval` (which look alike), `loops` (how a loop is
closed), `pose_graph` (GTSAM), `trimming` (old nodes go), `edge` and `result` (what goes in and
out), `map_cloud` (the map as one cloud). `maps`: maps that stay.
"""
from .config import MapperConfig
from .mapper import Mapper
from .maps.map import Map
from .maps.merging import Merged
from .maps.result import Located
from .maps.result import Place
from .result import Loop
from .result import MappedScan
from .result import Trajectory

__all__ = ['Located', 'Loop', 'Map', 'MappedScan', 'Mapper', 'MapperConfig', 'Merged', 'Place',
           'Trajectory']
