"""Bags of others, and bags that are broken: read, or refused with what to do about it."""
import sqlite3

from conftest import write_bag
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores

from sgor_ros import InputError
from sgor_ros.io.bags import BagReader
from sgor_ros.io.bags import CLOUD_TYPE
from sgor_ros.io.bounded import BoundedFile
from sgor_ros.io.label_field import label_field_of
from sgor_ros.io.pointcloud2 import decode

POINTS = np.random.default_rng(0).normal(0, 9, (200, 3)).astype(np.float32)


@pytest.fixture
def mcap(tmp_path):
    folder = write_bag(tmp_path / 'bag', [(POINTS, None, stamp_ns) for stamp_ns in (1, 2, 3)])
    return next(folder.glob('*.mcap'))


def read_all(path):
    with BagReader(path) as bag:
        return [decode(cloud.read()[2], '') for cloud in bag.clouds(bag.find_topic('auto'))]


def test_a_ros_1_bag_of_others(data_folder):
    scans = read_all(data_folder / 'bags/watercan.bag')
    assert {len(scan) for scan in scans} <= set(range(1, 13967))
    assert scans


def test_a_cloud_of_a_driver_of_others(data_folder):
    """Its numbers are not aligned."""
    raw = (data_folder / 'odd/cloudini_pointcloud2_cdr.bin').read_bytes()
    message = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(raw, CLOUD_TYPE)
    assert message.point_step % 4
    scan = decode(message, label_field_of(message, 'auto'))
    assert 0 < len(scan) <= 64000
    assert np.abs(scan.points).max() < 300


@pytest.mark.parametrize('share', [0.3, 0.9])
def test_a_bag_that_broke_off_says_what_mends_it(mcap, share):
    content = mcap.read_bytes()
    mcap.write_bytes(content[:int(share * len(content))])
    for path, advice in ((mcap, 'mcap recover'), (mcap.parent, 'ros2 bag reindex')):
        with pytest.raises(InputError, match=f'cannot be read: .*{advice}'):
            read_all(path)


def test_a_length_is_only_a_claim(mcap):
    """Broken, the length of the first record is an exabyte; no memory is asked for that."""
    content = bytearray(mcap.read_bytes())
    content[9:17] = (1 << 60).to_bytes(8, 'little')
    mcap.write_bytes(content)
    with pytest.raises(InputError, match=f'Truncated record .* expected {1 << 60} bytes'):
        read_all(mcap)


def test_a_bounded_file_gives_what_it_holds(tmp_path):
    (tmp_path / 'a').write_bytes(b'0123456789')
    with BoundedFile(tmp_path / 'a') as file:
        assert file.read(4) == b'0123'
        assert file.read(1 << 60) == b'456789'
        assert file.read(1 << 60) == b''
        file.seek(1 << 20)
        assert file.read(1 << 60) == b''
        file.seek(8)
        assert file.read() == b'89'


def test_a_bag_with_another_definition_of_a_cloud(mcap):
    content = mcap.read_bytes()
    assert b'uint32 point_step' in content
    mcap.write_bytes(content.replace(b'uint32 point_step', b'uint32 point_stop'))
    with pytest.raises(InputError, match='PointCloud2 has other fields than that of ROS'):
        read_all(mcap)


def test_a_count_in_the_metadata_that_is_none(mcap):
    metadata = mcap.parent / 'metadata.yaml'
    text = metadata.read_text()
    assert 'message_count: 3' in text
    metadata.write_text(text.replace('message_count: 3', 'message_count: three'))
    with pytest.raises(InputError, match='cannot be read: '):
        read_all(mcap.parent)


@pytest.mark.parametrize('kind', ['', '1.5', '[a]'])
def test_a_type_in_the_metadata_that_is_no_name(mcap, kind):
    """YAML holds whatever is written; found by fuzzing."""
    metadata = mcap.parent / 'metadata.yaml'
    text = metadata.read_text()
    assert f'type: {CLOUD_TYPE}' in text
    metadata.write_text(text.replace(f'type: {CLOUD_TYPE}', f'type: {kind}'))
    with pytest.raises(InputError, match='which is no name of a type'):
        read_all(mcap.parent)


def test_a_topic_that_is_no_name(tmp_path):
    """A column of sqlite3 holds whatever is put in."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        writer.add_connection('/points', CLOUD_TYPE, typestore=store)
    path = next((tmp_path / 'bag').glob('*.db3'))
    with sqlite3.connect(path) as database:
        database.execute("UPDATE topics SET name = x'0102'")
    with pytest.raises(InputError, match='is no name of a topic'):
        read_all(path)


@pytest.mark.parametrize(('plugin', 'suffix'), [
    (StoragePlugin.SQLITE3, '.db3'), (StoragePlugin.MCAP, '.mcap')])
def test_one_file_of_a_bag_is_enough(tmp_path, mcap, plugin, suffix):
    store = get_typestore(Stores.ROS2_JAZZY)
    with BagReader(mcap) as bag:
        _, _, message = next(bag.clouds('/points')).read()
    with Writer(tmp_path / 'other', version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection('/points', CLOUD_TYPE, typestore=store)
        writer.write(connection, 5, store.serialize_cdr(message, CLOUD_TYPE))
    scan, = read_all(next((tmp_path / 'other').glob(f'*{suffix}')))
    np.testing.assert_array_equal(scan.points, POINTS)
