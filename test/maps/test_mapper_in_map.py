"""A mapper that goes on in a map of before: begins lost, finds itself, adds what is new."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from return_drive import known_map
from return_drive import mapped
from return_drive import PERIOD_NS
from return_drive import return_drive
from return_drive import THERE
from return_drive import TURN

from sgor_ros import InputError
from sgor_ros import Map
from sgor_ros import Mapper
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig

pytest.importorskip('gtsam')

BACK = THERE + TURN


def truth(index, origin=0):
    return relative(return_drive()[origin][2], return_drive()[index][2])


def drive(mapper, indexes, start=0):
    return [mapper.track(SemanticScan(*return_drive()[index][:2]), (start + i) * PERIOD_NS)
            for i, index in enumerate(indexes)]


def error(scan, index, origin=0):
    return errors(scan.T_map_odom @ scan.T_odom_sensor, truth(index, origin))[0]


@pytest.fixture(scope='module')
def gone_on(tmp_path_factory):
    """Return a mapper that drove back in the map of yesterday, and what it said."""
    folder = tmp_path_factory.mktemp('maps') / 'yesterday'
    known_map().save(folder)
    mapper = Mapper(map=Map.load(folder))
    return mapper, drive(mapper, range(BACK, len(return_drive())))


def test_it_finds_itself_with_the_first_scan_and_stays_in_the_frame_of_the_map(gone_on):
    _, tracked = gone_on
    first = tracked[0]
    assert first.restarted
    assert len(first.loops) >= 2
    for i, scan in enumerate(tracked):
        assert error(scan, BACK + i) < 0.1
    # loops to keyframes of the map go on, their stamps are those of the first drive
    loops = [loop for scan in tracked[1:] for loop in scan.loops]
    assert len(loops) > 5
    assert {loop.target_stamp_ns for loop in loops} & {
        node.stamp_ns for node in known_map().nodes.values()}


def test_trajectory_and_map_know_both_drives(gone_on):
    mapper, tracked = gone_on
    stamps_ns, T_map_sensor = mapper.trajectory()
    assert len(stamps_ns) == len(tracked)    # the scans of this drive
    for i, T in enumerate(T_map_sensor):
        assert errors(T, truth(BACK + i))[0] < 0.1
    now = mapper.map
    assert now.sessions == (0, 1)
    assert known_map().nodes.keys() <= now.nodes.keys()
    assert len(now.nodes) > len(known_map().nodes)
    # no keyframes where there are some
    assert len(now.keyframes) <= len(known_map().keyframes) + 1
    assert known_map().sessions == (0,)


def test_what_the_map_does_not_know_is_said_until_it_is_reached():
    """A map of the first metres, entered from the far end of the street."""
    known = mapped(return_drive()[:THERE // 4]).map
    mapper = Mapper(map=known)
    indexes = [*range(BACK, len(return_drive()))]
    tracked = drive(mapper, indexes)
    found = [scan.T_map_odom is not None for scan in tracked]
    assert not found[0]
    assert any('not found in the map' in text for text in tracked[0].warnings)
    assert found == sorted(found)
    assert found[-1]
    assert 1 < found.index(True) < THERE - 3
    for scan, index in zip(tracked, indexes, strict=True):
        if scan.T_map_odom is not None:
            assert error(scan, index) < 0.15
    # what was driven before is in the map too now
    assert len(mapper.map.keyframes) > len(known.keyframes) + 2
    for T, index in zip(mapper.trajectory().T_map_sensor, indexes, strict=True):
        assert errors(T, truth(index))[0] < 0.15
    # and found by the next
    again = mapper.map.locate(SemanticScan(*return_drive()[THERE - 2][:2]))
    assert again.success
    assert errors(again.T_map_sensor, truth(THERE - 2))[0] < 0.15


def test_elsewhere_it_is_never_found(elsewhere):
    mapper = mapped(elsewhere, Mapper(map=known_map()))
    assert mapper.map.nodes.keys() == known_map().nodes.keys()
    assert not np.isin(mapper.trajectory().part, 0).any()


def test_settings_are_those_of_the_map_or_go_with_it():
    known = mapped([], Mapper(SgorConfig(voxel_size=0.4))).map
    assert Mapper(map=known).tracker.config.voxel_size == 0.4
    assert Mapper(SgorConfig(voxel_size=0.4, min_confidence=0.7), map=known
                  ).tracker.config.min_confidence == 0.7
    with pytest.raises(InputError, match=r'config: voxel_size = 0\.5, but the map'):
        Mapper(SgorConfig(voxel_size=0.5), map=known)
