"""One protocol for sequences of scans: folders and bags, one by one and in any order."""
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
import sys

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from test_datasets import WRITERS

from sgor_ros import InputError
from sgor_ros import open_drive
from sgor_ros import SemanticScan
from sgor_ros.commands.replay import main as replay
from sgor_ros.io.bags import BagReader
from sgor_ros.io.bags import BagWriter
from sgor_ros.io.datasets.bags import BagSequence
from sgor_ros.io.messages import point_cloud2

OPENED = []
sys.addaudithook(lambda event, arguments: OPENED.append(str(arguments[0]))
                 if event == 'open' else None)


def opened(bag):
    """Return how often the files of a bag were opened since this was asked before."""
    count = sum(name.startswith(str(bag)) and not name.endswith('.yaml') for name in OPENED)
    OPENED.clear()
    return count


def test_a_bag_is_opened_once_for_all_scans_in_any_order(street_bag, street, tmp_path):
    opened(street_bag)
    assert replay([str(street_bag), '--output', str(tmp_path / 'out')]) == 0
    assert opened(street_bag) == 1
    drive = open_drive(street_bag)
    for index in (2, 0, 3, 2, 1):
        np.testing.assert_array_equal(drive.read(index).points,
                                      SemanticScan(street[index][0]).points)
    assert opened(street_bag) == 1


def test_a_bag_is_read_by_threads_and_by_other_processes(street_bag, street):
    drive = open_drive(street_bag)
    expected = [SemanticScan(points).points for points, *_ in street]
    order = [3, 0, 2, 1] * 4
    with ThreadPoolExecutor(4) as pool:
        for index, scan in zip(order, pool.map(drive.read, order), strict=True):
            np.testing.assert_array_equal(scan.points, expected[index])
    for method in ('fork', 'spawn'):
        with ProcessPoolExecutor(2, get_context(method)) as pool:
            for index, scan in zip(order, pool.map(drive.read, order), strict=True):
                np.testing.assert_array_equal(scan.points, expected[index])


@pytest.mark.parametrize('layout', ['semantickitti', 'kitti', 'scans'])
def test_a_folder_and_a_bag_are_the_same_sequence(street, tmp_path, layout):
    """What they iterate over, and all messages of a replay, bit by bit."""
    folder = WRITERS[layout](tmp_path / 'data', street)
    drive = open_drive(folder)
    with BagWriter(tmp_path / 'bag') as writer:
        for scan in drive:
            read = scan.read()
            writer.write('/points', point_cloud2(writer.types, read.points, read.labels,
                                                 scan.stamp_ns, scan.frame_id), scan.stamp_ns)
    with BagReader(tmp_path / 'bag') as bag:
        sequence = BagSequence(bag, '/points')
        assert (sequence.expected, drive.expected) == (4, 4)
        for ours, theirs in zip(drive, sequence, strict=True):
            assert (ours.stamp_ns, ours.frame_id, ours.arrived_ns) == (
                theirs.stamp_ns, theirs.frame_id, theirs.arrived_ns)
            np.testing.assert_array_equal(ours.read().points, theirs.read().points)
            np.testing.assert_array_equal(ours.read().labels, theirs.read().labels)
        assert (sequence.label_convention, sequence.T_world_sensor) == (None, None)
    raw = []
    for source in (folder, tmp_path / 'bag'):
        out = tmp_path / f'out of {source.name}'
        assert replay([str(source), '--output', str(out), '--bag']) == 0
        with AnyReader([out / 'bag']) as bag:
            raw.append([(connection.topic, time_ns, bytes(message))
                        for connection, time_ns, message in bag.messages()])
    assert len(raw[0]) == 4 + 4 + 3 + 4
    assert raw[0] == raw[1]


def test_the_labels_of_a_folder_are_read_or_not(street, tmp_path, capsys):
    folder = WRITERS['semantickitti'](tmp_path / '08', street[:2])
    assert all(scan.read().labels is None for scan in open_drive(folder).without_labels())
    command = [str(folder), '--output', str(tmp_path / 'out'), '--bag', '--label-field']
    assert replay([*command, 'class_id']) == 2
    assert "label_field = 'class_id': only the clouds of a bag have" in capsys.readouterr().err
    assert replay([*command, 'none']) == 0


def test_a_broken_cloud_of_a_bag_is_told_when_it_is_read(street, tmp_path):
    bag = tmp_path / 'bag'
    with BagWriter(bag) as writer:
        for index in range(3):
            cloud = point_cloud2(writer.types, *street[index][:2], 7 + index, 'lidar')
            if index == 1:
                cloud.data = cloud.data[:100]
            writer.write('/points', cloud, 7 + index)
    drive = open_drive(bag)
    assert drive.stamps_ns.tolist() == [7, 8, 9]
    with pytest.raises(InputError, match='data: 100 bytes'):
        drive.read(1)
    assert len(drive.read(2)) == len(SemanticScan(street[2][0]))
