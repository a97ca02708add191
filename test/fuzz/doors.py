"""The doors of the library: what reads an input, and what must hold of that which it lets in."""
from argparse import Namespace
from collections.abc import Callable
from contextlib import redirect_stderr
from dataclasses import dataclass
from functools import partial
import io

import map_folders
from mutate import mutated
import numpy as np
import prepared_scans
import seeds

from sgor_ros.commands.options import configured
from sgor_ros.commands.options import read_parameters
from sgor_ros.core.config import SgorConfig
from sgor_ros.core.registration import register
from sgor_ros.core.scan.labels import label_convention
from sgor_ros.core.scan.scan import SemanticScan
from sgor_ros.io.bags import BagReader
from sgor_ros.io.broken import readable
from sgor_ros.io.compact_scans import read_compact_scan
from sgor_ros.io.label_field import label_field_of
from sgor_ros.io.pointcloud2 import decode
from sgor_ros.io.scans import read_labels
from sgor_ros.io.scans import read_scan
from sgor_ros.io.trajectories import read_calibration
from sgor_ros.io.trajectories import read_poses
from sgor_ros.io.trajectories import read_timed_poses
from sgor_ros.io.trajectories import read_times


@dataclass(frozen=True)
class Door:
    """One way in.

    Attributes
    ----------
    file : str
        Name that the input gets in a folder of its own.
    good : function
        Returns inputs that are fine.
    read : function
        Takes the path of the input.
    make : function, optional
        Makes an input by random numbers that spoiling bytes would hardly make.
    beside : dict of str to bytes
        What lies in the folder besides.
    """

    file: str
    good: Callable[[], list[bytes]]
    read: Callable
    make: Callable | None = None
    beside: Callable[[], dict[str, bytes]] = dict

    def input(self, good, rng):
        """Return an input; `good` are those of `good()`."""
        if self.make is not None and rng.random() < 0.5:
            return self.make(rng)
        return mutated(rng.choice(good), good, rng)


def _scan(scan):
    assert scan.points.dtype == np.float32
    assert scan.points.ndim == 2
    assert len(scan) > 0
    assert np.isfinite(scan.points).all()
    if scan.labels is not None:
        assert scan.labels.dtype == np.int64
        assert scan.labels.shape == (len(scan),)
        # any ids may be looked up
        label_convention('semantickitti').decode(scan.labels)


def _array(path):
    with readable(path):
        array = np.load(path, allow_pickle=False)
    _scan(SemanticScan(array))
    register(array, array)


def _cloud(path):
    with readable(path):
        message = seeds.STORE.deserialize_cdr(path.read_bytes(), seeds.CLOUD)
    _scan(decode(message, label_field_of(message, 'auto')))


def _label_file(path):
    labels = read_labels(path, 12)
    assert labels.dtype == np.int64
    assert labels.shape == (12,)


def _label_table(path):
    label_convention.cache_clear()
    table = label_convention(str(path))
    ids = np.array([0, 1, 40, 252, 2**16 - 1, 2**32 - 1, -1, 2**62])
    classes, keep, unknown = table.decode(ids)
    assert classes.dtype == np.uint8
    assert keep.shape == classes.shape == ids.shape
    assert len(unknown) <= len(ids)


def _compact_scan(path):
    restored = read_compact_scan(path).restored()
    register(restored, restored)


def _parameters(path):
    with redirect_stderr(io.StringIO()):
        arguments = Namespace(params_file=path)
        found = read_parameters(arguments, SgorConfig)
        configured(SgorConfig(), arguments, found)


def _bag(path, folder=False):
    with BagReader(path.parent if folder else path) as bag:
        clouds = bag.clouds(bag.find_topic('auto'))
        for _, cloud in zip(range(20), clouds, strict=False):
            _, _, message = cloud.read()
            _scan(decode(message, label_field_of(message, 'auto')))


def _motions(read, path):
    assert np.isfinite(read(path)).all()


def _truth(path):
    stamps_ns, poses = read_timed_poses(path)
    if stamps_ns is not None:    # in the format of KITTI a pose may be missing
        assert len(stamps_ns) == len(poses)
        assert (np.diff(stamps_ns) >= 0).all()
        assert np.isfinite(poses).all()


def _times(path):
    stamps_ns = read_times(path)
    assert all(0 <= stamp_ns < 2**63 for stamp_ns in stamps_ns)
    assert stamps_ns == sorted(set(stamps_ns))


def _map_file(name, spoil_arrays=True):
    def good():
        return map_folders.folder()[name]

    return Door(name, lambda: [good()], map_folders.read,
                partial(prepared_scans.made_archive, good, mutated) if spoil_arrays else None,
                partial(map_folders.others, name))


DOORS = {
    'cloud': Door('cloud.cdr', seeds.clouds, _cloud, seeds.made_cloud),
    'array': Door('a.npy', seeds.arrays, _array, seeds.made_array),
    'bin': Door('a.bin', seeds.bins, lambda path: _scan(read_scan(path))),
    'label': Door('a.label', seeds.labels, _label_file),
    'npz': Door('a.npz', seeds.npzs, lambda path: _scan(read_scan(path)),
                partial(seeds.made_npz, mutated)),
    'compact_scan': Door(
        'a.npz', lambda: [prepared_scans.compact_scan()], _compact_scan,
        partial(prepared_scans.made_archive, prepared_scans.compact_scan, mutated)),
    'pcd': Door('a.pcd', seeds.pcds, lambda path: _scan(read_scan(path))),
    'ply': Door('a.ply', seeds.plys, lambda path: _scan(read_scan(path))),
    'label_toml': Door('a.toml', seeds.label_tomls, _label_table),
    'label_json': Door('a.json', seeds.label_jsons, _label_table),
    'label_yaml': Door('a.yaml', seeds.label_yamls, _label_table),
    'parameter_yaml': Door('a.yaml', seeds.parameter_yamls, _parameters),
    'mcap': Door('a.mcap', seeds.mcaps, _bag),
    'sqlite3': Door('a.db3', seeds.sqlites, _bag),
    'packed_messages': Door('a.db3', seeds.packed_messages, _bag),
    'packed_file': Door('bag.db3.zstd', lambda: [seeds.packed_files()['bag.db3.zstd']],
                        partial(_bag, folder=True), partial(seeds.made_packed_file, mutated),
                        beside=lambda: {'metadata.yaml': seeds.packed_files()['metadata.yaml']}),
    'ros1': Door('a.bag', seeds.bags, _bag),
    'metadata': Door('metadata.yaml', seeds.metadatas, partial(_bag, folder=True),
                     beside=lambda: {'bag.mcap': seeds.mcaps()[0]}),
    'map_index': _map_file(map_folders.INDEX, spoil_arrays=False),
    'map_graph': _map_file(map_folders.GRAPH),
    'map_keyframes': _map_file(map_folders.KEYFRAMES),
    'map_scan': _map_file(map_folders.SCAN),
    'times': Door('times.txt', seeds.times, _times),
    'poses': Door('poses.txt', seeds.poses, partial(_motions, read_poses)),
    'truth': Door('truth.tum', seeds.truths, _truth),
    'calib': Door('calib.txt', seeds.calibrations, partial(_motions, read_calibration)),
}
