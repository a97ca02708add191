"""Where in a map a scan was taken: on the built-in street and on a real drive."""
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
from sgor_ros import Mapper
from sgor_ros import open_drive
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import Status
from sgor_ros.core.common import se3
from sgor_ros.mapping.edge import Edge
from sgor_ros.mapping.keyframe import Keyframe
from sgor_ros.mapping.maps import localisation
from sgor_ros.mapping.maps.localisation import AT_ONCE

pytest.importorskip('gtsam')

BACK = (THERE + TURN, THERE + TURN + 7, THERE + TURN + 14, THERE + TURN + 21)


def turned(points, yaw):
    """Return the points of a sensor that is turned to the left."""
    return points @ se3.rotations(np.array([0, 0, yaw]))


def truth(index, yaw=0.0):
    T = relative(return_drive()[0][2], return_drive()[index][2])
    return T @ se3.compose(se3.rotations(np.array([0, 0, yaw])), np.zeros(3))


def scan_of(index, yaw=0.0, labels=True):
    points, its, _ = return_drive()[index]
    return SemanticScan(turned(points, yaw), its if labels else None)


def shifted(known, T):
    """Return a map whose frame is another."""
    nodes = {node.id: replace(node, T_map_sensor=T @ node.T_map_sensor)
             for node in known.nodes.values()}
    return replace(known, nodes=nodes)


def twice(known, T, copied=None):
    """Return a map with a second floor at T_map_floor, on which some nodes look the same.

    Stairs lead there, of which little is known.
    """
    offset = max(known.nodes) + 1
    copied = list(known.nodes) if copied is None else copied
    nodes = {**known.nodes, **{node + offset: replace(shifted(known, T).nodes[node],
                                                      id=node + offset) for node in copied}}
    edges = [replace(edge, target=edge.target + offset, source=edge.source + offset)
             for edge in known.edges if {edge.target, edge.source} <= set(copied)]
    T_node = known.nodes[copied[0]].T_map_sensor
    stairs = Edge(copied[0], copied[0] + offset, np.linalg.inv(T_node) @ T @ T_node,
                  np.diag([25.0] * 3 + [0.1] * 3))
    keyframes = known.keyframes.copy()
    for one in known.keyframes:
        if one.id in copied:
            keyframes.put(replace(one, id=one.id + offset))
    return replace(known, nodes=nodes, edges=(*known.edges, *edges, stairs), keyframes=keyframes)


@pytest.mark.parametrize('labels', [True, False])
@pytest.mark.parametrize(('index', 'yaw'), [*zip(BACK, (0.0, 1.0, 2.5, -2.0), strict=True)])
def test_the_other_lane_the_other_way_any_yaw(index, yaw, labels):
    found = known_map().locate(scan_of(index, yaw, labels))
    assert found.success
    assert found.status is Status.REGISTERED
    assert found.reason == ''
    metres, degrees = errors(found.T_map_sensor, truth(index, yaw))
    assert metres < 0.1
    assert degrees < 0.5
    assert found.alternatives == ()
    assert found.keyframe in known_map().keyframes
    assert found.confidence > 0.5
    assert len({edge.target for edge in found.edges}) == len(found.edges) >= 2


def test_wrong_labels_do_not_stop_it():
    points, labels, _ = return_drive()[BACK[1]]
    rng = np.random.default_rng(0)
    wrong = rng.random(len(labels)) < 0.2
    labels = np.where(wrong, rng.choice(np.unique(labels), len(labels)), labels)
    found = known_map().locate(SemanticScan(points, labels))
    assert found.success
    assert errors(found.T_map_sensor, truth(BACK[1]))[0] < 0.1


def test_pose_and_covariance_are_those_of_the_registration_in_the_frame_of_the_map():
    T_new_map = se3.compose(se3.rotations(np.array([0.1, -0.2, 1.5])), np.array([5.0, -3.0, 1.0]))
    scan = preprocess(scan_of(BACK[1]), known_map().config)
    found = known_map().locate(scan)
    keyframe = known_map().keyframes[found.keyframe]
    seen = register(scan, keyframe.scan.restored())
    T_map_target = known_map().nodes[found.keyframe].T_map_sensor
    assert errors(found.T_map_sensor, T_map_target @ seen.T_target_source)[0] < 0.01
    R = T_map_target[:3, :3]
    np.testing.assert_allclose(found.covariance[:3, :3], R @ seen.covariance[:3, :3] @ R.T,
                               rtol=0.5, atol=1e-6)
    other = shifted(known_map(), T_new_map).locate(scan)
    np.testing.assert_allclose(other.T_map_sensor, T_new_map @ found.T_map_sensor, atol=1e-9)
    J = se3.turned(T_new_map[:3, :3])
    np.testing.assert_allclose(other.covariance, J @ found.covariance @ J.T, atol=1e-12)
    np.linalg.cholesky(found.covariance)


def test_places_that_the_map_does_not_have_are_refused(elsewhere):
    for points, labels, _ in elsewhere[:2]:
        found = known_map().locate(SemanticScan(points, labels))
        assert not found.success
        assert found.status is Status.REFUSED
        assert 'keyframes that look alike' in found.reason
        assert found.T_map_sensor is None
        assert found.attempts <= 30


def test_two_floors_alike_are_ambiguous_wherever_the_other_is():
    upstairs = np.eye(4)
    upstairs[:3, 3] = 0, 0, 40
    house = twice(known_map(), upstairs)
    found = house.locate(scan_of(BACK[1]))
    assert not found.success
    assert found.status is Status.AMBIGUOUS
    assert '2 places' in found.reason
    assert found.confidence <= 0.5
    floors = [found.T_map_sensor, *(place.T_map_sensor for place in found.alternatives)]
    floors.sort(key=lambda T: T[2, 3])
    assert errors(floors[0], truth(BACK[1]))[0] < 0.1
    assert errors(floors[1], upstairs @ truth(BACK[1]))[0] < 0.1


def test_a_mapper_does_not_choose_between_floors_alike():
    upstairs = np.eye(4)
    upstairs[:3, 3] = 0, 0, 40
    mapper = Mapper(map=twice(known_map(), upstairs))
    points, labels, _ = return_drive()[BACK[1]]
    for i in range(2):
        seen = mapper.track(SemanticScan(points, labels), i * PERIOD_NS)
        assert seen.success
        assert seen.T_map_odom is None
        assert seen.loops == ()


def test_what_is_driven_decides_between_floors_alike():
    """Upstairs is like the first metres; what comes after them is only down here."""
    upstairs = np.eye(4)
    upstairs[:3, 3] = 0, 0, 40
    known = known_map()
    mapper = Mapper(map=twice(known, upstairs, list(known.nodes)[:2]))
    found = []
    for i in range(THERE):
        points, labels, _ = return_drive()[i]
        seen = mapper.track(SemanticScan(points, labels), i * PERIOD_NS)
        found.append(seen.T_map_odom is not None)
        if found[-1]:
            assert errors(seen.T_map_odom @ seen.T_odom_sensor, truth(i))[0] < 0.15
    assert not found[0]
    assert found[-1]
    for i, T in enumerate(mapper.trajectory().T_map_sensor):
        assert errors(T, truth(i))[0] < 0.15


def test_one_keyframe_alone_is_not_enough():
    known = known_map()
    one = replace(known, keyframes=known.keyframes.copy([next(iter(known.keyframes)).id]))
    found = one.locate(scan_of(2))
    assert found.status is Status.REFUSED
    assert 'none agrees' in found.reason
    assert errors(found.T_map_sensor, truth(2))[0] < 0.1    # to look at


@pytest.mark.parametrize('hint', [0, 20])
def test_a_hint_may_be_wrong(hint):
    found = known_map().locate(scan_of(BACK[1]), truth(hint))
    assert found.success
    assert errors(found.T_map_sensor, truth(BACK[1]))[0] < 0.1


def test_a_hint_comes_first(monkeypatch):
    asked = []
    monkeypatch.setattr(Keyframe, 'scan', property(lambda self: (
        asked.append(self.id), self.held)[1]))
    known_map().locate(scan_of(BACK[1]), truth(0))
    assert min(known_map().nodes) in asked[:AT_ONCE]


@pytest.mark.parametrize('hint', [np.zeros(3), np.full((4, 4), np.nan), np.diag([2, 1, 1, 1])])
def test_a_hint_that_is_no_pose_is_refused(hint):
    with pytest.raises(InputError, match='hint'):
        known_map().locate(scan_of(0), hint)


def test_a_scan_that_was_prepared_otherwise_is_refused():
    with pytest.raises(InputError, match=r'scan: prepared with voxel_size = 0\.4'):
        known_map().locate(preprocess(scan_of(0), SgorConfig(voxel_size=0.4)))


def test_points_are_enough_and_an_empty_map_has_no_place():
    assert known_map().locate(return_drive()[BACK[1]][0]).success
    assert Map().locate(scan_of(0)).reason == 'the map has no keyframes'


@pytest.fixture(scope='module')
def real(data_folder):
    """Return a map of a real drive, and the scans with their poses, the first as origin."""
    drive = open_drive(data_folder.parent / 'drives/kitti_08b')
    scans = [scan.read() for scan in drive]
    poses = [relative(drive.T_world_sensor[0], T) for T in drive.T_world_sensor]
    return mapped([(scan.points, None, None) for scan in scans[::2]]).map, scans, poses


@pytest.mark.parametrize('index', [1, 13, 27, 41, 55])
def test_a_real_drive_is_recognised_turned_by_any_yaw(real, index):
    known, scans, poses = real
    yaw = 0.7 * index
    found = known.locate(turned(scans[index].points, yaw))
    assert found.success
    T = poses[index] @ se3.compose(se3.rotations(np.array([0, 0, yaw])), np.zeros(3))
    metres, degrees = errors(found.T_map_sensor, T)
    assert metres < 0.6
    assert degrees < 2


def test_another_real_drive_is_refused(real, data_folder):
    foreign = open_drive(data_folder.parent / 'drives/hdl32')
    for scan in list(foreign)[10:40:20]:
        assert not real[0].locate(scan.read()).success


@pytest.mark.parametrize('index', [2, BACK[1]])
def test_one_thread_and_two_find_the_same(index):
    known = known_map()
    one, two = (replace(known, config=known.config.replace(threads=threads)).locate(
        scan_of(index, 1.0)) for threads in (1, 2))
    assert np.array_equal(one.T_map_sensor, two.T_map_sensor)
    assert np.array_equal(one.covariance, two.covariance)
    assert one.attempts == two.attempts


def test_only_what_a_quick_attempt_does_not_rule_out_is_tried_thoroughly(monkeypatch, elsewhere):
    tried = []
    monkeypatch.setattr(localisation, 'register', lambda source, target, config: (
        tried.append(config.max_correspondences), register(source, target, config))[1])
    points, labels, _ = elsewhere[0]
    for hopeless, thorough in ((0.5, 0), (-1.0, localisation.THOROUGH)):
        tried.clear()
        monkeypatch.setattr(localisation, 'HOPELESS', hopeless)
        found = known_map().locate(SemanticScan(points, labels))
        assert not found.success
        assert tried.count(SgorConfig.max_correspondences) == thorough
        assert found.attempts == len(tried) == localisation.QUICK + thorough
