"""Loops and a pose graph on top of the tracker, without ROS and without files.

`mapper` is the way of one scan. Beside it: `odometry` (nodes and edges out of tracked scans),
`keyframe` (what is kept of a scan), `retrieval` (which look alike), `candidates` (which pairs to
try and when), `verification` (they are registered), `loop_consistency` (which loops to believe, by
`paths`: the surest way between two nodes), `pose_graph` (GTSAM), `edge` and `result` (what goes in
and out). `map_cloud` (the map as one cloud). `maps` (maps that stay), `relocalisation` (where in
one of them the sensor is, while it is lost).
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
