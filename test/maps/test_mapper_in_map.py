"""A mapper that goes on in a map of before: begins lost, finds itself, adds what is new."""
from dataclasses import replace

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
from return_drive import twice

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


def test_frozen_it_follows_the_map_and_adds_nothing_until_it_is_told():
    """In a map of the first metres, from its end on to where it knows nothing."""
    known = mapped(return_drive()[:THERE // 2]).map
    mapper = Mapper(map=known)
    mapper.freeze()
    indexes = range(THERE // 2 - 3, THERE - 7)
    for scan, index in zip(drive(mapper, indexes), indexes, strict=True):
        assert error(scan, index) < 0.15
    assert mapper.frozen
    assert mapper.map.nodes.keys() == known.nodes.keys()
    assert len(mapper.map.edges) == len(known.edges)
    for node, its in mapper.map.nodes.items():
        np.testing.assert_array_equal(its.T_map_sensor, known.nodes[node].T_map_sensor)
    assert {one.id for one in mapper.keyframes} == {one.id for one in known.keyframes}
    mapper.freeze(False)
    drive(mapper, range(THERE - 7, THERE), start=100)
    assert mapper.map.sessions == (0, 1)
    assert len(mapper.map.keyframes) > len(known.keyframes)


def test_what_cannot_be_followed_is_said():
    with pytest.raises(InputError, match='no map to follow'):
        Mapper().freeze()


def test_it_begins_anew_in_another_map(elsewhere):
    mapper = mapped(elsewhere)
    mapper.begin_in(known_map())
    tracked = drive(mapper, range(BACK, BACK + 3), start=50)
    assert tracked[0].restarted
    assert tracked[0].track_id == 2
    for i, scan in enumerate(tracked):
        assert error(scan, BACK + i) < 0.1
    assert mapper.map.sessions == (0, 1)
    assert len(mapper.trajectory().stamps_ns) == 3    # what was mapped before is gone
    with pytest.raises(InputError, match='voxel_size'):
        mapper.begin_in(mapped([], Mapper(SgorConfig(voxel_size=0.4))).map)
    assert error(drive(mapper, [BACK + 3], start=60)[0], BACK + 3) < 0.1    # in it still


@pytest.mark.parametrize('hinted', [BACK, 2])
def test_a_hint_is_tried_first_and_may_be_wrong(monkeypatch, hinted):
    hints = []
    locate = Map.locate
    monkeypatch.setattr(Map, 'locate', lambda self, scan, hint=None: (
        hints.append(hint), locate(self, scan, hint))[1])
    mapper = Mapper(map=known_map())
    mapper.hint(truth(hinted))
    for i, scan in enumerate(drive(mapper, range(BACK, BACK + 3))):
        assert error(scan, BACK + i) < 0.1
    np.testing.assert_array_equal(hints[0], truth(hinted))
    assert len(hints) <= 2


def test_a_hint_of_one_of_two_floors_alike_decides_nothing():
    upstairs = np.eye(4)
    upstairs[:3, 3] = 0, 0, 40
    mapper = Mapper(map=twice(known_map(), upstairs))
    mapper.hint(upstairs @ truth(BACK + 3))
    points, labels, _ = return_drive()[BACK + 3]
    for i in range(2):
        seen = mapper.track(SemanticScan(points, labels), i * PERIOD_NS)
        assert seen.T_map_odom is None
        floors = sorted(seen.hypotheses, key=lambda T: T[2, 3])
        assert len(floors) == 2
        assert errors(floors[0], truth(BACK + 3))[0] < 0.15
        assert errors(floors[1], upstairs @ truth(BACK + 3))[0] < 0.15


def test_hypotheses_move_with_the_sensor_and_end_where_it_is_found():
    upstairs = np.eye(4)
    upstairs[:3, 3] = 0, 0, 40
    known = known_map()
    mapper = Mapper(map=twice(known, upstairs, list(known.nodes)[:2]))
    found = False
    for i, scan in enumerate(drive(mapper, range(THERE))):
        found |= scan.T_map_odom is not None
        assert not (found and scan.hypotheses)
        if scan.hypotheses:
            near = min(errors(T, truth(i))[0] for T in scan.hypotheses)
            assert near < 0.2
    assert found


@pytest.mark.parametrize('hint', [np.zeros(3), np.full((4, 4), np.nan), np.diag([2, 1, 1, 1])])
def test_a_hint_that_is_no_pose_is_refused(hint):
    with pytest.raises(InputError, match='T_map_sensor'):
        Mapper(map=known_map()).hint(hint)


def test_carried_away_it_is_found_though_keyframes_were_bent():
    """Two keyframes disagree by 0.4 m, and know that they may."""
    bent = 0.4
    known, keyframes = known_map(), known_map().keyframes.copy()
    for i, one in enumerate(known.keyframes):
        compact, arrays = one.scan, dict(one.scan.arrays)
        moved = np.array([bent if i % 2 else 0.0, 0.0, 0.0])
        for name in ('points', 'surface_points', 'origin'):
            arrays[name] = (arrays[name] + moved).astype(arrays[name].dtype)
        keyframes.put(replace(one, held=replace(compact, arrays=arrays),
                              frame_covariance=np.diag([bent**2] * 3 + [1e-6] * 3)))
    mapper = Mapper(map=replace(known, keyframes=keyframes))
    indexes = [*range(3), THERE - 2, THERE - 1]
    told = drive(mapper, indexes)
    assert any('another place of the map' in text for text in told[3].warnings)
    assert error(told[4], THERE - 1) < 2 * bent
