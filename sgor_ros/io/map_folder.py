"""A map as a folder that a person can look into, and back."""
from collections.abc import Mapping
from dataclasses import asdict
from dataclasses import dataclass
import io
import json
from pathlib import Path
from typing import Any
import zlib

import numpy as np
from numpy.typing import NDArray

from ..core.common.checks import as_laid_out
from ..core.common.checks import Layout
from ..core.common.settings import InputError
from ..core.common.settings import Settings
from ..core.compact_scan import CompactScan
from ..core.config import SgorConfig
from ..mapping.config import MapperConfig
from ..mapping.edge import Edge
from ..mapping.edge import Kind
from ..mapping.keyframe import Keyframe
from ..mapping.keyframe import Keyframes
from ..mapping.maps.map import Map
from ..mapping.maps.map import MapNode
from ..tracker import TrackerConfig
from .broken import readable
from .g2o import write_g2o
from .trajectories import write_tum
from .writing import replaced_folder

Arrays = dict[str, NDArray[Any]]

FORMAT, VERSION = 'sgor_ros map', 2
"""Of the folder, as it is written."""
READABLE = (1, VERSION)
"""Others are refused. In version 1 nothing is told of the mount of the sensor."""
INDEX = 'map.json'
SETTINGS: dict[str, type[Settings]] = {'config': SgorConfig, 'tracker_config': TrackerConfig,
                                       'mapper_config': MapperConfig}
KINDS = list(Kind)
GRAPH: Layout = {
    'nodes': (np.int64, ('N',)), 'stamps_ns': (np.int64, ('N',)), 'sessions': (np.int64, ('N',)),
    'T_map_sensor': (np.float64, ('N', 4, 4)), 'targets': (np.int64, ('E',)),
    'sources': (np.int64, ('E',)), 'T_target_source': (np.float64, ('E', 4, 4)),
    'covariances': (np.float64, ('E', 6, 6)), 'kinds': (np.uint8, ('E',))}
KEYFRAMES: Layout = {
    'nodes': (np.int64, ('K',)), 'track_ids': (np.int64, ('K',)),
    'descriptors': (np.float32, ('K', 'D')),
    # of a scan that was not deskewed all zero
    'frame_covariances': (np.float64, ('K', 6, 6))}
README = """A map of sgor_ros: `sgor_ros.Map.load` reads it, `sgor_map show` draws it.

map.json       version, settings that it was made with, size and CRC-32 of every file, and the
               mount of the sensor (T_base_sensor, row by row; null where nobody told)
graph.npz      nodes (stamp, session, pose in the map) and edges (relative pose, covariance)
keyframes.npz  what the keyframes look like, for place recognition
keyframes/     a scan each, by the number of its node: numpy.load reads it, without pickle
poses.tum      the poses of all nodes, for people and tools: seconds x y z qx qy qz qw
graph.g2o      nodes and edges, likewise

poses.tum, graph.g2o and this file are written and not read. Metres, radians, nanoseconds.

Poses are those of the sensor, in the frame of the first scan, which is tilted where the sensor is.
T_base_sensor times a pose lies in the frame of the vehicle, x forward and z up. The node publishes
in that frame, and `sgor_map export` writes clouds and grids in it; without a mount the frame of
the first scan takes its place.
"""
TEXTS = ('README.txt', 'poses.tum', 'graph.g2o')


@dataclass(frozen=True)
class StoredFile:
    """A file of the map as it was written; calling it reads the scan that it holds.

    Attributes
    ----------
    path : Path
    size : int
        Bytes.
    crc32 : int
    """

    path: Path
    size: int
    crc32: int

    def __call__(self) -> CompactScan:
        """Return the scan.

        Raises
        ------
        InputError
            The file is missing or damaged.
        """
        try:
            return CompactScan.from_arrays(_arrays(self.path, self.content()))
        except InputError as error:
            raise InputError(f'{error}' if str(self.path) in str(error)
                             else f'{self.path}: {error}') from error

    def content(self) -> bytes:
        """Return its bytes.

        Raises
        ------
        InputError
            The file is missing, or not what was written.
        """
        with readable(self.path):
            content = self.path.read_bytes()
        if len(content) != self.size or zlib.crc32(content) != self.crc32:
            raise InputError(f'{self.path}: damaged, or of another map: {len(content)} bytes with '
                             f'CRC-32 {zlib.crc32(content):08x}, expected {self.size} with '
                             f'{self.crc32:08x}')
        return content


def write_map(folder: str | Path, known: Map) -> None:
    """Write a map to a folder: see `Map.save`.

    Raises
    ------
    InputError
    """
    folder = Path(folder)
    if not len(known.keyframes):
        raise InputError(f'{folder}: the map has no keyframes, so there is nothing to save')
    if folder.exists() and not (folder / INDEX).is_file() and not (
            folder.is_dir() and not any(folder.iterdir())):
        raise InputError(f'{folder}: is there and no map, so it is not replaced')
    with replaced_folder(folder) as place:
        place.mkdir()
        (place / 'keyframes').mkdir()
        for keyframe in known.keyframes:
            held = keyframe.held
            (place / _name(keyframe.id)).write_bytes(
                held.content() if isinstance(held, StoredFile)
                else _npz(keyframe.scan.as_arrays()))
        nodes = sorted(known.nodes.values(), key=lambda node: node.id)
        (place / 'graph.npz').write_bytes(_npz(_graph(nodes, known.edges)))
        (place / 'keyframes.npz').write_bytes(_npz({
            'nodes': np.array([one.id for one in known.keyframes], np.int64),
            'track_ids': np.array([one.track_id for one in known.keyframes], np.int64),
            'descriptors': np.array([one.descriptor for one in known.keyframes], np.float32),
            'frame_covariances': np.array([
                np.zeros((6, 6)) if one.frame_covariance is None else one.frame_covariance
                for one in known.keyframes])}))
        (place / 'README.txt').write_text(README)
        by_time = sorted(nodes, key=lambda node: (node.session, node.stamp_ns))
        write_tum(place / 'poses.tum', [node.stamp_ns for node in by_time],
                  [node.T_map_sensor for node in by_time])
        write_g2o(place / 'graph.g2o', {node.id: node.T_map_sensor for node in nodes}, known.edges)
        _write_index(place, known)


def read_map(folder: str | Path) -> dict[str, Any]:
    """Return what a map is made of: see `Map.load`.

    Raises
    ------
    InputError
    """
    folder = Path(folder)
    index = _read_index(folder)
    with readable(folder / INDEX):
        files = {name: StoredFile(folder / name, int(size), int(crc32))
                 for name, (size, crc32) in index['files'].items()}
        settings = {name: kind.from_values(index[name]) for name, kind in SETTINGS.items()}
        mount = index.get('T_base_sensor')
        T_base_sensor = None if mount is None else np.array(mount, np.float64).reshape(4, 4)
    warnings = []
    for name, file in files.items():
        try:
            _check_size(file)
            if name in TEXTS:
                file.content()
        except InputError as error:
            if name not in TEXTS:
                raise
            warnings.append(f'{error}; it is not read')
    graph = _read(files, folder / 'graph.npz', GRAPH)
    keyframes = _read(files, folder / 'keyframes.npz', KEYFRAMES)
    with readable(folder / 'graph.npz'):
        nodes = {node: MapNode(node, stamp_ns, session, T) for node, stamp_ns, session, T in zip(
            graph['nodes'].tolist(), graph['stamps_ns'].tolist(), graph['sessions'].tolist(),
            graph['T_map_sensor'], strict=True)}
        edges = tuple(Edge(target, source, T, covariance, KINDS[kind])
                      for target, source, T, covariance, kind in zip(
                          graph['targets'].tolist(), graph['sources'].tolist(),
                          graph['T_target_source'], graph['covariances'],
                          graph['kinds'].tolist(), strict=True))
        if not {node for edge in edges for node in (edge.target, edge.source)} <= nodes.keys():
            raise InputError(f'{folder / "graph.npz"}: an edge of no node')
    kept = Keyframes()
    with readable(folder / 'keyframes.npz'):
        for node, track_id, descriptor, frame in zip(
                keyframes['nodes'].tolist(), keyframes['track_ids'].tolist(),
                keyframes['descriptors'], keyframes['frame_covariances'], strict=True):
            if node not in nodes or _name(node) not in files:
                raise InputError(f'{folder / "keyframes.npz"}: node {node} has no scan or no pose')
            kept.put(Keyframe(node, nodes[node].stamp_ns, track_id, files[_name(node)],
                              descriptor, frame if frame.any() else None))
    return {'nodes': nodes, 'edges': edges, 'keyframes': kept, 'warnings': tuple(warnings),
            'T_base_sensor': T_base_sensor, **settings}


def _name(node: int) -> str:
    return f'keyframes/{node:06d}.npz'


def _graph(nodes: list[MapNode], edges: tuple[Edge, ...]) -> Arrays:
    made: dict[str, Any] = {
        'nodes': [node.id for node in nodes], 'stamps_ns': [node.stamp_ns for node in nodes],
        'sessions': [node.session for node in nodes],
        'T_map_sensor': [node.T_map_sensor for node in nodes],
        'targets': [edge.target for edge in edges], 'sources': [edge.source for edge in edges],
        'T_target_source': [edge.T_target_source for edge in edges],
        'covariances': [edge.covariance for edge in edges],
        'kinds': [KINDS.index(edge.kind) for edge in edges]}
    return {name: np.array(made[name], kind).reshape(
        -1, *(side for side in shape[1:] if isinstance(side, int)))
        for name, (kind, shape) in GRAPH.items()}


def _write_index(place: Path, known: Map) -> None:
    """Write what the folder holds, with a checksum of its own."""
    index: dict[str, Any] = {
        'format': FORMAT, 'version': VERSION, 'nodes': len(known.nodes),
        'keyframes': len(known.keyframes), 'sessions': len(known.sessions),
        **{name: asdict(getattr(known, name)) for name in SETTINGS},
        'T_base_sensor': (None if known.T_base_sensor is None
                          else known.T_base_sensor.tolist()),
        'files': {str(path.relative_to(place)): (path.stat().st_size,
                                                 zlib.crc32(path.read_bytes()))
                  for path in sorted(place.rglob('*')) if path.is_file()}}
    index['crc32'] = _checksum(index)
    (place / INDEX).write_text(json.dumps(index, indent=1) + '\n')


def _read_index(folder: Path) -> dict[str, Any]:
    path = folder / INDEX
    if not path.is_file():
        raise InputError(f'{folder}: no map: there is no {INDEX} in it' if folder.is_dir() else
                         f'{folder}: no such folder')
    with readable(path):
        index = json.loads(path.read_text())
    if not isinstance(index, dict) or index.get('format') != FORMAT:
        raise InputError(f'{path}: not the index of a map')
    if index.get('version') not in READABLE:
        raise InputError(f'{path}: a map of version {index.get("version")!r}; this program reads '
                         f'version {READABLE[0]} to {READABLE[-1]}')
    if index.pop('crc32', None) != _checksum(index):
        raise InputError(f'{path}: damaged: its checksum does not fit')
    return index


def _checksum(index: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(index, sort_keys=True).encode())


def _check_size(file: StoredFile) -> None:
    with readable(file.path):
        size = file.path.stat().st_size
    if size != file.size:
        raise InputError(f'{file.path}: damaged: {size} bytes, expected {file.size}')


def _read(files: Mapping[str, StoredFile], path: Path, layout: Layout) -> Arrays:
    """Return the arrays of a file, of the right types and shapes."""
    if path.name not in files:
        raise InputError(f'{path.parent / INDEX}: {path.name} is not in it')
    arrays = _arrays(path, files[path.name].content())
    try:
        return as_laid_out(arrays, layout)[0]
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def _npz(arrays: Arrays) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def _arrays(path: Path, content: bytes) -> Arrays:
    with readable(path), np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return {name: np.asarray(arrays[name]) for name in arrays.files}
