"""Bags as other programs leave them: compressed, without stamps, of drivers' own types."""
from conftest import PERIOD_NS
import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat
from rosbags.rosbag2 import CompressionMode
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer
from rosbags.typesys import get_types_from_msg
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from sgor_ros import InputError
from sgor_ros import open_drive
from sgor_ros.commands.replay import main as replay
from sgor_ros.io.bags import BagReader
from sgor_ros.io.messages import point_cloud2

CLOUD = 'sensor_msgs/msg/PointCloud2'
LIVOX_POINT = 'uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\n' \
    'uint8 tag\nuint8 line'
LIVOX = 'std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\n' \
    'uint8[3] rsvd\nlivox_ros_driver2/CustomPoint[] points'


def write_clouds(path, street, stamps_ns, compression=None):
    store = get_typestore(Stores.ROS2_JAZZY)
    bag = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    if compression is not None:
        bag.set_compression(compression, CompressionFormat.ZSTD)
    with bag:
        connection = bag.add_connection('/points', CLOUD, typestore=store)
        for i, (stamp_ns, (points, labels, _)) in enumerate(zip(stamps_ns, street, strict=False)):
            cloud = point_cloud2(store.types.__getitem__, points, labels, stamp_ns, 'lidar')
            bag.write(connection, (7 + i) * PERIOD_NS, store.serialize_cdr(cloud, CLOUD))
    return path


def test_compressed_messages_without_their_metadata(street, tmp_path):
    whole = write_clouds(tmp_path / 'bag', street, [0, PERIOD_NS], CompressionMode.MESSAGE)
    alone = next(whole.glob('*.db3')).rename(tmp_path / 'alone.db3')
    with BagReader(alone) as bag:
        for cloud, (points, *_) in zip(bag.clouds('/points'), street, strict=False):
            assert cloud.read()[2].width == len(points)
    np.testing.assert_array_equal(open_drive(alone).read(1).points, street[1][0])


def test_a_compressed_file_alone_says_what_it_needs(street, tmp_path):
    whole = write_clouds(tmp_path / 'bag', street, [0, PERIOD_NS], CompressionMode.FILE)
    np.testing.assert_array_equal(open_drive(whole).read(1).points, street[1][0])
    alone = next(whole.glob('*.zstd')).rename(tmp_path / 'alone.db3.zstd')
    with pytest.raises(InputError, match=r'give the folder with its metadata\.yaml, or zstd -d'):
        open_drive(alone)


def test_a_folder_of_ros1_bags_names_them(tmp_path, capsys):
    for name in ('a.bag', 'b.bag'):
        (tmp_path / name).write_bytes(b'#ROSBAG V2.0')
    assert replay([str(tmp_path)]) == 2
    assert 'a folder of ROS 1 bags, give one of them: a.bag, b.bag' in capsys.readouterr().err


def test_clouds_of_livox_are_named_with_a_way_out(tmp_path, capsys):
    store = get_typestore(Stores.ROS2_JAZZY)
    name = 'livox_ros_driver2/msg/CustomMsg'
    store.register({**get_types_from_msg(LIVOX_POINT, 'livox_ros_driver2/msg/CustomPoint'),
                    **get_types_from_msg(LIVOX, name)})
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connection = bag.add_connection('/livox/lidar', name, typestore=store)
        bag.write(connection, 5, b'\x00\x01\x00\x00' + bytes(64))
    assert replay([str(tmp_path / 'bag')]) == 2
    said = capsys.readouterr().err
    assert '/livox/lidar has CustomMsg (Livox: start the driver with xfer_format 0' in said


def test_clouds_without_stamps_have_the_times_of_their_recording(street, tmp_path, capsys):
    path = write_clouds(tmp_path / 'bag', street, [0] * len(street))
    drive = open_drive(path)
    assert drive.stamps_ns.tolist() == [(7 + i) * PERIOD_NS for i in range(len(street))]
    np.testing.assert_array_equal(drive.read(2).points, street[2][0])
    assert 'have no stamps' in drive.warnings[0]
    assert replay([str(path), '--output', str(tmp_path / 'out')]) == 0
    assert 'warning: the clouds have no stamps' in capsys.readouterr().err
    rows = np.loadtxt(tmp_path / 'out/trajectory.tum')
    np.testing.assert_allclose(rows[:, 0], [0.7, 0.8, 0.9, 1.0])


def test_a_drive_that_begins_at_zero_keeps_its_stamps(street, tmp_path):
    drive = open_drive(write_clouds(tmp_path / 'bag', street, [0, PERIOD_NS, 2 * PERIOD_NS]))
    assert drive.stamps_ns.tolist() == [0, PERIOD_NS, 2 * PERIOD_NS]
    assert drive.warnings == ()
