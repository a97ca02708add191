"""Good inputs, small ones, so that what is spoilt is rarely a mere coordinate."""
from functools import cache
import io
import json
from pathlib import Path
import tempfile
import tomllib
import zipfile

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat
from rosbags.rosbag2 import CompressionMode
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores
import yaml

from sgor_ros.core.scan.labels import TABLES
from sgor_ros.io.bags import zstd  # of Python or of its backport
from sgor_ros.io.messages import point_cloud2

CLOUD = 'sensor_msgs/msg/PointCloud2'
CONFIG = Path(__file__).resolve().parents[2] / 'config'
POINTS = np.random.default_rng(0).normal(0, 20, (12, 3)).astype(np.float32)
LABELS = np.arange(12) * 5
STORE = get_typestore(Stores.ROS2_JAZZY)
STORE1 = get_typestore(Stores.ROS1_NOETIC)


def message(labels=LABELS, store=STORE):
    types = dict(store.types)
    if store is STORE1:    # its header counts
        plain = types['std_msgs/msg/Header']
        types['std_msgs/msg/Header'] = lambda **values: plain(seq=0, **values)
    return point_cloud2(types.__getitem__, POINTS, labels, 7_000_000_000, 'lidar')


def clouds():
    return [bytes(STORE.serialize_cdr(message(labels), CLOUD)) for labels in (LABELS, None)]


def made_cloud(rng):
    """Return a cloud whose numbers are right for its type, but for nothing else."""
    def number():
        return rng.choice((0, 1, 2, 4, 12, 16, 17, 192, 2**31, 2**32 - 1))

    cloud = message()
    for name in rng.sample(('width', 'height', 'point_step', 'row_step'), rng.randrange(3)):
        setattr(cloud, name, number())
    for field in rng.sample(cloud.fields, rng.randrange(3)):
        field.name = rng.choice(('x', 'y', 'z', 'label', 'ring', ''))
        field.offset = rng.choice((field.offset, number()))
        field.datatype = rng.randrange(12)
        field.count = rng.choice((1, 1, 0, number()))
    cloud.fields = rng.choices(cloud.fields, k=rng.randrange(6)) if rng.random() < 0.3 else \
        cloud.fields
    cloud.is_bigendian = rng.random() < 0.2
    cloud.data = np.frombuffer(rng.randbytes(rng.choice((192, 192, 0, 191, 400))), np.uint8)
    return bytes(STORE.serialize_cdr(cloud, CLOUD))


def bins():
    return [np.hstack((POINTS, np.ones((12, 1)))).astype('<f4').tobytes(),
            np.random.default_rng(1).normal(0, 9, (400, 5)).astype('<f4').tobytes(),
            np.cumsum(np.ones((400, 5)), axis=0).astype('<f4').tobytes()]


def labels():
    return [LABELS.astype('<u4').tobytes(), LABELS.astype('u1').tobytes()]


def npzs():
    found = []
    for save in (np.savez, np.savez_compressed):
        for arrays in ({'points': POINTS, 'labels': LABELS}, {'points': POINTS.astype('f8')}):
            file = io.BytesIO()
            save(file, **arrays)
            found.append(file.getvalue())
    return found


def npys():
    found = []
    for array in (POINTS, LABELS):
        file = io.BytesIO()
        np.save(file, array)
        found.append(file.getvalue())
    return found


def arrays():
    """Return what holds a scan in memory: (N, 3), (N, 4), fields as of ROS."""
    fields = np.zeros(12, [(axis, '<f4') for axis in 'xyz'] + [('label', '<u4')])
    fields['x'], fields['y'], fields['z'], fields['label'] = *POINTS.T, LABELS
    return [_npy(array) for array in (POINTS, np.hstack((POINTS, POINTS[:, :1])), fields)]


def made_array(rng):
    """Return an array of any types, fields and shape, of any bytes."""
    types = ('<f4', '>f4', '<f8', '<f2', 'u1', '<u4', '<i8', '<u8', '?', '<c8', 'S3', '<U2',
             '<M8[s]', '<m8[s]', '(2,)<f4', '(0,)<f4')
    names = rng.sample(('x', 'y', 'z', 'label', 'class_id', 'ring'), rng.randrange(1, 7))
    if rng.random() < 0.7:
        names = list(dict.fromkeys([*'xyz', *names]))
    kind = np.dtype([(name, rng.choice(types[:4] if rng.random() < 0.8 else types))
                     for name in names] if rng.random() < 0.7 else rng.choice(types))
    shape = rng.choice(((12,), (3, 4), (12, 3), (12, 4), (4, 4), (0, 3), (), (2, 3, 2), (1, 3)))
    size = int(np.prod(shape)) * kind.itemsize
    return _npy(np.ndarray(shape, kind, rng.randbytes(size) + bytes(16)))


def _npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def made_npz(mutate, rng):
    """Return an archive that is whole, of arrays that are not."""
    file = io.BytesIO()
    packing = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2,
                          zipfile.ZIP_LZMA))
    with zipfile.ZipFile(file, 'w', packing) as archive:
        for name, good in zip(('points.npy', 'labels.npy'), npys(), strict=True):
            archive.writestr(name, mutate(good, npys(), rng) if rng.random() < 0.7 else good)
    return file.getvalue()


def lzf(data):
    """Pack by what LZF allows: runs of bytes as they are, and for zeros a repetition."""
    out = bytearray()
    at = 0
    while at < len(data):
        if at and data[at:at + 8] == data[at - 1:at] * 8:
            out += b'\xc0\x00'
            at += 8
            continue
        run = data[at:at + 8]
        out += bytes([len(run) - 1]) + run
        at += len(run)
    return bytes(out)


def pcds():
    header = ('# .PCD v0.7\nVERSION 0.7\nFIELDS x y z label\nSIZE 4 4 4 4\nTYPE F F F U\n'
              'COUNT 1 1 1 1\nWIDTH 12\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 12\nDATA ')
    packed = np.hstack((POINTS.view('<u4'), LABELS[:, None].astype('<u4')))
    rows = ''.join(f'{x:.4f} {y:.4f} {z:.4f} {label}\n' for (x, y, z), label
                   in zip(POINTS, LABELS, strict=True))
    columns = packed.T.tobytes()
    shrunk = lzf(columns)
    sizes = np.array([len(shrunk), len(columns)], '<u4').tobytes()
    return [(header + 'ascii\n' + rows).encode(), header.encode() + b'binary\n' + packed.tobytes(),
            header.encode() + b'binary_compressed\n' + sizes + shrunk]


def plys():
    header = ('ply\nformat {} 1.0\ncomment a\nelement vertex 12\nproperty float x\n'
              'property float y\nproperty float z\nproperty uint label\nelement face 1\n'
              'property list uchar int vertex_indices\nend_header\n')
    packed = np.hstack((POINTS.view('<u4'), LABELS[:, None].astype('<u4')))
    rows = ''.join(f'{x:.4f} {y:.4f} {z:.4f} {label}\n' for (x, y, z), label
                   in zip(POINTS, LABELS, strict=True))
    return [(header.format('ascii') + rows + '3 0 1 2\n').encode(),
            header.format('binary_little_endian').encode() + packed.tobytes() + bytes([3] * 13),
            header.format('binary_big_endian').encode() + packed.astype('>u4').tobytes()]


def label_tomls():
    return [path.read_bytes() for path in sorted(TABLES.glob('*.toml'))]


def label_yamls():
    return [yaml.safe_dump(_table(text)).encode() for text in label_tomls()]


def label_jsons():
    return [json.dumps(_table(text)).encode() for text in label_tomls()]


def _table(text):
    return tomllib.loads(text.decode())


def parameter_yamls():
    return [path.read_bytes()[:1000] for path in sorted(CONFIG.glob('*.yaml'))] + [
        b'/**:\n  ros__parameters:\n    voxel_size: 0.5\n    max_voxels: 400\n    scale: 1\n']


def times():
    return [b''.join(b'%.6e\n' % (0.1 * i) for i in range(12))]


def poses():
    return [b'1 0 0 0 0 1 0 0 0 0 1 0\n0.8 -0.6 0 5 0.6 0.8 0 -2.5e1 0 0 1 0\n' * 4]


def truths():
    return [b'# stamp x y z qx qy qz qw\n' + b''.join(
        b'%d.%09d %d -2.5e1 0.5 0 0 0.6 0.8\n' % (1691936557 + i, 946849179, i)
        for i in range(8)), *poses()]


def calibrations():
    return [b'P0: 7 0 6 0 0 7 1 0 0 0 1 0\n\nTr: 0 -1 0 0.1 0 0 -1 -0.2 1 0 0 -0.3\n']


def _bag2(plugin, **packing):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag'
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if packing:
            writer.set_compression(**packing)
        with writer:
            connection = writer.add_connection('/points', CLOUD, typestore=STORE)
            for stamp_ns in (1, 2, 3):
                writer.write(connection, stamp_ns, clouds()[stamp_ns % 2])
        return {path.name: path.read_bytes() for path in path.iterdir()}


def _file(files, suffix):
    return next(data for name, data in files.items() if name.endswith(suffix))


@cache
def mcaps():
    return [_file(_bag2(StoragePlugin.MCAP), '.mcap'),
            _file(_bag2(StoragePlugin.MCAP, mode=CompressionMode.STORAGE,
                        fmt=CompressionFormat.ZSTD), '.mcap')]


@cache
def sqlites():
    return [_file(_bag2(StoragePlugin.SQLITE3), '.db3')]


@cache
def packed_messages():
    return [_file(_bag2(StoragePlugin.SQLITE3, mode=CompressionMode.MESSAGE,
                        fmt=CompressionFormat.ZSTD), '.db3')]


@cache
def packed_files():
    return _bag2(StoragePlugin.SQLITE3, mode=CompressionMode.FILE, fmt=CompressionFormat.ZSTD)


def made_packed_file(mutate, rng):
    """Return a file that is packed well, of a bag that is spoilt."""
    return zstd.compress(mutate(sqlites()[0], sqlites(), rng))


def metadatas():
    return [_file(_bag2(StoragePlugin.MCAP), 'metadata.yaml')]


def bags():
    found = []
    for packing in (None, Writer1.CompressionFormat.BZ2, Writer1.CompressionFormat.LZ4):
        with tempfile.TemporaryDirectory() as folder:
            writer = Writer1(Path(folder) / 'a.bag')
            if packing:
                writer.set_compression(packing)
            with writer:
                connection = writer.add_connection('/points', CLOUD, typestore=STORE1)
                for stamp_ns in (1, 2, 3):
                    writer.write(connection, stamp_ns,
                                 STORE1.serialize_ros1(message(store=STORE1), CLOUD))
            found.append((Path(folder) / 'a.bag').read_bytes())
    return found
