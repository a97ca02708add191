"""Two maps of one street become one; what shares nothing does not."""
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

from sgor_ros import InputError
from sgor_ros import Map
from sgor_ros import SgorConfig
from sgor_ros.mapping.edge import Kind

pytest.importorskip('gtsam')

BACK = THERE + TURN - 2


@pytest.fixture(scope='module')
def back():
    """Return the map of the way back, in the frame of its own first scan."""
    return mapped(return_drive()[BACK:], start=BACK).map


@pytest.fixture(scope='module')
def merged(back):
    return known_map().merge(back)


def test_two_drives_in_opposite_directions_become_one_graph(back, merged):
    assert merged.success
    assert merged.reason == ''
    joined = merged.map
    assert len(joined.nodes) == len(known_map().nodes) + len(back.nodes)
    assert len(joined.keyframes) == len(known_map().keyframes) + len(back.keyframes)
    for node in joined.nodes.values():
        true = relative(return_drive()[0][2], return_drive()[node.stamp_ns // PERIOD_NS][2])
        metres, degrees = errors(node.T_map_sensor, true)
        assert metres < 0.1
        assert degrees < 0.5
    assert errors(merged.T_map_other, relative(return_drive()[0][2],
                                               return_drive()[BACK][2]))[0] < 0.1


def test_sessions_and_loops_are_told_apart(back, merged):
    joined, first = merged.map, len(known_map().nodes)
    sessions = [node.session for node in joined.nodes.values()]
    assert sessions == [0] * first + [1] * len(back.nodes)
    assert len(merged.loops) >= 4
    assert len({loop.source for loop in merged.loops}) >= 2
    for loop in merged.loops:
        assert loop.kind is Kind.LOOP
        assert joined.nodes[loop.target].session == 0
        assert joined.nodes[loop.source].session == 1


def test_neither_map_changes(back, merged):
    assert known_map().sessions == back.sessions == (0,)
    np.testing.assert_array_equal(next(iter(back.nodes.values())).T_map_sensor, np.eye(4))


def test_the_merged_map_is_one_to_work_with(merged, tmp_path):
    merged.map.save(tmp_path / 'both')
    both = Map.load(tmp_path / 'both')
    assert both.sessions == (0, 1)
    points, _, T = return_drive()[THERE + TURN + 5]
    found = both.locate(points)
    assert found.success
    assert errors(found.T_map_sensor, relative(return_drive()[0][2], T))[0] < 0.1
    third = both.merge(known_map())
    assert third.map.sessions == (0, 1, 2)


def test_maps_that_share_nothing_are_refused(elsewhere):
    foreign = mapped(elsewhere).map
    assert len(foreign.keyframes) >= 2
    merged = known_map().merge(foreign)
    assert not merged.success
    assert merged.map is None
    assert 'only 0 of' in merged.reason


def test_one_keyframe_in_common_is_not_enough(back):
    few = replace(back, keyframes=back.keyframes.copy(list(back.nodes)[-1:]))
    assert len(few.keyframes) <= 1
    merged = known_map().merge(few)
    assert not merged.success
    assert '2 have to agree' in merged.reason


def test_maps_of_other_settings_are_refused(back):
    other = replace(back, config=SgorConfig(voxel_size=0.4))
    with pytest.raises(InputError, match=r'other: voxel_size = 0\.4, but this map'):
        known_map().merge(other)
