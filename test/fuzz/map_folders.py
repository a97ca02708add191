"""Folders of maps: a file spoilt, and the checksums made to fit it, so that more is looked at."""
from functools import cache
import json
from pathlib import Path
import tempfile
import zlib

import numpy as np
import prepared_scans
import seeds

from sgor_ros.core.scan.scan import SemanticScan
from sgor_ros.io.map_folder import _checksum
from sgor_ros.io.map_folder import INDEX
from sgor_ros.mapping import Map
from sgor_ros.mapping import Mapper
from sgor_ros.mapping.edge import Edge
from sgor_ros.mapping.edge import Kind
from sgor_ros.mapping.keyframe import Keyframes
from sgor_ros.mapping.maps.map import MapNode

GRAPH, KEYFRAMES, SCAN = 'graph.npz', 'keyframes.npz', 'keyframes/000001.npz'


@cache
def folder():
    """Return the files of a map of three nodes and two keyframes, by name."""
    prepared = prepared_scans.prepared()
    kept = Keyframes()
    for node in (0, 1):
        kept.add(node, 10**9 * node, 0, prepared)
    nodes = {node: MapNode(node, 10**9 * node, 0, np.eye(4)) for node in range(3)}
    edges = tuple(Edge(node, node + 1, np.eye(4), 1e-2 * np.eye(6), Kind.ODOMETRY)
                  for node in (0, 1))
    with tempfile.TemporaryDirectory() as where:
        place = Path(where) / 'map'
        Map(nodes=nodes, edges=edges, keyframes=kept).save(place)
        return {str(path.relative_to(place)): path.read_bytes()
                for path in sorted(place.rglob('*')) if path.is_file()}


def others(name):
    """Return what lies beside a file."""
    return {other: content for other, content in folder().items() if other != name}


def read(path):
    """Load a map, find a scan in it and go on in it."""
    place = next(parent for parent in path.parents if (parent / INDEX).is_file())
    _mend_checksums(place, path)
    known = Map.load(place)
    assert all(np.isfinite(node.T_map_sensor).all() for node in known.nodes.values())
    found = known.locate(prepared_scans.prepared())
    assert found.T_map_sensor is None or np.isfinite(found.T_map_sensor).all()
    Mapper(map=known).track(SemanticScan(seeds.POINTS), 5 * 10**9)


def _mend_checksums(place, path):
    try:
        index = json.loads((place / INDEX).read_text())
        if path.name != INDEX:
            content = path.read_bytes()
            index['files'][str(path.relative_to(place))] = len(content), zlib.crc32(content)
        index.pop('crc32', None)
        index['crc32'] = _checksum(index)
        text = json.dumps(index)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return
    (place / INDEX).write_text(text)
