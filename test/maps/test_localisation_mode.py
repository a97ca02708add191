"""For days in a map that stays as it is: poses as good as before, memory that does not grow."""
from dataclasses import replace
import gc
import tracemalloc

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

from sgor_ros import Loop
from sgor_ros import Mapper
from sgor_ros import MapperConfig
from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.core.common import se3
from sgor_ros.mapping import trimming

pytest.importorskip('gtsam')

BACK = [*range(THERE + TURN, 2 * THERE + TURN)]
FEW = 2


def test_with_few_nodes_it_is_as_exact_and_tells_of_every_scan(monkeypatch):
    monkeypatch.setattr(trimming, 'NEWEST', FEW)
    known = known_map()
    mapper = Mapper(map=known)
    mapper.freeze()
    nodes, loops = 0, []
    for i, index in enumerate(BACK):
        scan = mapper.track(SemanticScan(*return_drive()[index][:2]), i * PERIOD_NS)
        true = relative(return_drive()[0][2], return_drive()[index][2])
        assert errors(scan.T_map_odom @ scan.T_odom_sensor, true)[0] < 0.1
        nodes += scan.keyframe
        loops.append(len(scan.loops))
        assert len(mapper.graph) <= len(known.nodes) + 2 * FEW + 1    # and the last of the track
        assert set(mapper.node_stamps_ns()) == set(mapper.graph.nodes)
    assert nodes > 2 * FEW + 3
    assert sum(loops[-6:]) > 0
    # nodes that went are in the trajectory, where they were
    stamps_ns, T_map_sensor = mapper.trajectory()
    np.testing.assert_array_equal(stamps_ns, np.arange(len(BACK)) * PERIOD_NS)
    for index, T in zip(BACK, T_map_sensor, strict=True):
        assert errors(T, relative(return_drive()[0][2], return_drive()[index][2]))[0] < 0.1
    assert len(set(mapper.trajectory().part)) == 1
    # and mapping goes on with those that are left
    mapper.freeze(False)
    assert known.nodes.keys() < mapper.map.nodes.keys()
    assert len(mapper.map.nodes) <= len(known.nodes) + 2 * FEW + 1


def test_past_the_end_of_the_map_it_goes_on_by_odometry(monkeypatch):
    """Where no loop holds what is driven, the nodes that are left stay joined to the map."""
    monkeypatch.setattr(trimming, 'NEWEST', FEW)
    known = mapped(return_drive()[:4]).map
    mapper = Mapper(mapper_config=MapperConfig(loop_radius=1.0, alike_candidates=0), map=known)
    mapper.freeze()
    for i, index in enumerate(range(3, THERE)):
        scan = mapper.track(SemanticScan(*return_drive()[index][:2]), i * PERIOD_NS)
        true = relative(return_drive()[0][2], return_drive()[index][2])
        assert errors(scan.T_map_odom @ scan.T_odom_sensor, true)[0] < 0.2
    assert len(mapper.graph) <= len(known.nodes) + 2 * FEW + 1
    first = next(iter(known.nodes))
    sure, unsure = (mapper.consistency.paths.sigmas(node, [first])[0]
                    for node in (max(known.nodes), mapper.graph.nodes[-1]))
    assert np.isfinite(unsure)
    assert unsure > sure


class Said:
    """Hands a mapper what a tracker might say of scans 1 m apart, up and down the first 20 m.

    Every third is a keyframe. No scan is registered.
    """

    def __init__(self, mapper):
        self.mapper, self.count, self.keyframes, self.track = mapper, 0, 0, 1
        self.references = {}    # of each track
        tracker = Tracker()
        self.origin = tracker.track(SemanticScan(*return_drive()[0][:2]), 0)
        self.prepared = tracker.reference.prepared
        self.begins = {}

    def scan(self):
        """Add the next scan; return its stamp, and whether it was a keyframe."""
        T, begins = np.eye(4), self.track not in self.begins
        T[0, 3] = 20 * abs((self.count / 20 + 1) % 2 - 1)
        T_odom_sensor = se3.inverse(self.begins.setdefault(self.track, T)) @ T
        keyframe, stamp_ns = begins or self.count % 3 == 0, (1000 + self.count) * PERIOD_NS
        self.keyframes += keyframe
        self.mapper.add(replace(
            self.origin, stamp_ns=stamp_ns, track_id=self.track, restarted=begins,
            T_odom_sensor=T_odom_sensor, covariance=1e-6 * (1 + self.count) * np.eye(6),
            reference_id=self.references.get(self.track),
            reference_covariance=1e-6 * np.eye(6), keyframe=keyframe,
            keyframe_id=self.keyframes if keyframe else None), self.prepared)
        if keyframe:
            self.references[self.track] = self.keyframes
        self.count += 1
        return stamp_ns, T, keyframe


@pytest.fixture
def frozen():
    """Return a mapper that follows a map and registers nothing."""
    mapper = Mapper(mapper_config=MapperConfig(registrations_per_scan=0), map=known_map())
    mapper.freeze()
    return mapper


def test_memory_grows_by_the_trajectory_alone(frozen, monkeypatch):
    """With a loop to the map at each node, of which a graph of all would keep tenfold."""
    monkeypatch.setattr(trimming, 'NEWEST', 30)
    said, first = Said(frozen), next(iter(known_map().nodes.values()))
    counts, sizes, scans = [], [], 3 * 2 * trimming.NEWEST

    def go_on():
        for _ in range(scans):
            stamp_ns, T, keyframe = said.scan()
            if keyframe:
                frozen.offer(Loop(stamp_ns, first.stamp_ns, T, 1e-4 * np.eye(6)))
        gc.collect()
        counts.append((len(frozen.graph), len(frozen.graph.edges)))

    go_on()
    tracemalloc.start()
    for _ in range(3):
        go_on()
        sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    most = len(known_map().nodes) + 2 * trimming.NEWEST + 1
    assert all(nodes <= most for nodes, _ in counts)
    assert max(edges for _, edges in counts[1:]) < 3 * most
    # 112 bytes, and room that lists of them keep
    assert (sizes[2] - sizes[1]) / scans < 200
    stamps_ns, T_map_sensor = frozen.trajectory()
    assert len(stamps_ns) == said.count == 4 * scans
    x = 20 * np.abs((np.arange(said.count) / 20 + 1) % 2 - 1)
    np.testing.assert_allclose(T_map_sensor[:, 0, 3], x, atol=0.02)
    assert set(frozen.trajectory().part) == {0}


def test_a_track_that_was_left_long_ago_can_come_back(frozen, monkeypatch):
    """Its last node stays."""
    monkeypatch.setattr(trimming, 'NEWEST', FEW)
    said = Said(frozen)
    for track, scans in ((1, 8), (2, 40), (1, 8)):
        said.track = track
        if track == 1 and said.count:
            said.references[1] = 1    # recognised by its first keyframe, whose node went
        for _ in range(scans):
            said.scan()
    trajectory = frozen.trajectory()
    assert len(trajectory.stamps_ns) == 56
    assert len(frozen.graph) <= len(known_map().nodes) + 2 * FEW + 2
    assert len(set(trajectory.part)) == 2
    assert trajectory.part[0] == trajectory.part[-1]
