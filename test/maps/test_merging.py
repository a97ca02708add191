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
from sgor_ros.io.executors import executor
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


def test_what_is_not_known_of_the_frames_is_in_the_loops(back, merged):
    """Of either map; a turn of the sensor has to be in it."""
    def unsure(known, covariance):
        keyframes = known.keyframes.copy()
        for one in known.keyframes:
            keyframes.put(replace(one, frame_covariance=covariance))
        return replace(known, keyframes=keyframes)

    of_other, of_known = np.diag([0.04, 0.01, 0, 0, 0, 0]), np.diag([0, 0, 0.09, 0, 0, 0])
    again = unsure(known_map(), of_known).merge(unsure(back, of_other))
    before = {(loop.target, loop.source): loop for loop in merged.loops}
    common = [loop for loop in again.loops if (loop.target, loop.source) in before]
    assert common
    for loop in common:
        more = loop.covariance - before[loop.target, loop.source].covariance
        R = loop.T_target_source[:3, :3]
        np.testing.assert_allclose(more[:3, :3], R @ of_other[:3, :3] @ R.T + of_known[:3, :3],
                                   atol=1e-9)


def test_over_processes_and_on_a_cluster_it_becomes_the_same_graph(back, merged, tmp_path,
                                                                  monkeypatch):
    """Of maps in memory and of maps in folders, three keyframes a task."""
    from distributed import LocalCluster
    monkeypatch.setattr('sgor_ros.mapping.maps.merging.TOGETHER', 3)
    known_map().save(tmp_path / 'there')
    back.save(tmp_path / 'back')
    with executor(2) as workers:
        assert_same(known_map().merge(back, workers), merged)
    with (LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
          executor(dask=cluster.scheduler_address) as workers):
        assert_same(Map.load(tmp_path / 'there').merge(Map.load(tmp_path / 'back'), workers),
                    merged)


def assert_same(one, other):
    """Assert that two merged maps are the same, bit by bit."""
    assert (one.success, one.reason, one.found) == (other.success, other.reason, other.found)
    assert list(one.map.nodes) == list(other.map.nodes)
    for node, its in other.map.nodes.items():
        np.testing.assert_array_equal(one.map.nodes[node].T_map_sensor, its.T_map_sensor)
    for edge, its in zip(one.map.edges, other.map.edges, strict=True):
        assert (edge.target, edge.source, edge.kind) == (its.target, its.source, its.kind)
        np.testing.assert_array_equal(edge.T_target_source, its.T_target_source)
        np.testing.assert_array_equal(edge.covariance, its.covariance)
    assert [one.id for one in one.map.keyframes] == [one.id for one in other.map.keyframes]
