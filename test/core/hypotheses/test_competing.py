"""The other placements that explain two scans, and the directions in which they slide."""
from itertools import pairwise

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros.core.degeneracy.directions import DegenerateDirection
from sgor_ros.core.degeneracy.directions import in_words
from sgor_ros.core.degeneracy.directions import inflated
from sgor_ros.core.degeneracy.directions import perturbed_poses
from sgor_ros.core.degeneracy.directions import slid_back
from sgor_ros.core.degeneracy.localizability import information
from sgor_ros.core.degeneracy.localizability import weak_directions
from sgor_ros.core.features.features import Features
from sgor_ros.core.hypotheses.competing import hypothesis_test
from sgor_ros.core.hypotheses.map_correlation import correlate_maps
from sgor_ros.core.icp.point_to_plane import icp
from sgor_ros.core.index.range_image import range_image
from sgor_ros.core.index.scan_index import scan_index
from sgor_ros.core.scoring.comparison import differ
from sgor_ros.core.scoring.comparison import ruled_out
from sgor_ros.world import Lidar
from sgor_ros.world import scenes

REACH = 0.6
UP = np.array([0.0, 0.0, 1.0])
ALONG_X = np.array([1.0, 0, 0, 0, 0, 0])
BOUND = 20.06    # of chi2 with 6 degrees of freedom at 99.73 %


def moved(x, y=0.0, z=0.0, yaw_deg=0.0):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('z', yaw_deg, degrees=True).as_matrix()
    T[:3, 3] = x, y, z
    return T


def gallery(pitch=8.0, offset=0.0, ends=(-40.0, 40.0)):
    """Return what is seen between two walls at y = 4 and -4 with a pillar each `pitch` metres.

    Points and unit normals towards the sensor, (V, 3) each.
    """
    points, normals = [], []
    for y in (-4.0, 4.0):
        wall = np.stack(np.meshgrid(np.arange(*ends, 0.5), [y], np.arange(-1.5, 3, 0.5)), -1)
        points.append(wall.reshape(-1, 3))
        normals.append(np.tile([0.0, -np.sign(y), 0.0], (len(points[-1]), 1)))
    if pitch:
        for x in np.arange(ends[0] + (offset - ends[0]) % pitch, ends[1], pitch):
            for dx, facing in ((-0.6, -1.0), (0.6, 1.0)):
                side = np.stack(np.meshgrid([x + dx], [-3.4, -2.9, -2.4],
                                            np.arange(-1.5, 3, 0.5)), -1).reshape(-1, 3)
                points.append(side)
                normals.append(np.tile([facing, 0.0, 0.0], (len(side), 1)))
    return np.concatenate(points), np.concatenate(normals)


def view_of(points, normals, up=UP):
    labels = np.zeros(len(points), np.uint8)
    features = Features(points, labels, labels, np.zeros((len(points), 3), np.float32))
    # the walls densely, as a sensor sees them
    steps = np.arange(-0.25, 0.3, 0.1)
    dense = np.concatenate([points + (i * normals[:, [1, 0, 2]] + [0, 0, j])
                            for i in steps for j in steps])
    return scan_index(range_image(dense.astype(np.float32)), features, normals, up, REACH)


@pytest.fixture(scope='module')
def bare():
    return view_of(*gallery(pitch=0.0))


@pytest.fixture(scope='module')
def pillars():
    return view_of(*gallery(pitch=8.0))


def test_rivals_are_ruled_out_by_what_they_alone_violate():
    """Of 1,000 points: 5 more violations and three times those of the answer, or no support."""
    answer = np.ones(1000, np.int8)
    answer[:2] = -1

    def rival(violations, violations_of_answer_explained=0, silent=0):
        said = np.zeros(1000, np.int8)
        said[2 + violations:1000 - silent] = 1
        said[2:2 + violations] = -1
        said[:violations_of_answer_explained] = 1
        return said
    asked = np.array([rival(0), rival(4), rival(5), rival(100), rival(5, 1), rival(6, 1),
                      rival(0, 0, 540), rival(0, 0, 560)])
    assert ruled_out(answer, asked).tolist() == [False, False, True, True, False, True, False,
                                                 True]


def test_placements_differ_in_the_plane_of_the_ground(bare):
    others = np.array([moved(0.5), moved(0.7), moved(0, 0, 2), moved(0, yaw_deg=4),
                       moved(0, yaw_deg=6)])
    assert differ(np.eye(4), others, bare).tolist() == [False, True, False, False, True]
    tumbling = view_of(*gallery(pitch=0.0), up=None)
    assert differ(np.eye(4), others, tumbling).tolist() == [False, True, True, False, True]


def test_the_overhead_maps_correlate_one_pitch_apart(pillars):
    """Both ways, straight and turned round, though nothing says so but the pillars."""
    found = correlate_maps(pillars, pillars, np.eye(4), 30.0)
    straight = found[np.abs(found[:, 0, 0] - 1) < 1e-9]
    assert np.abs(np.abs(straight[:, 0, 3]) % 8.0).tolist() == pytest.approx(
        [0.0] * len(straight), abs=8.0)
    assert (np.abs(straight[:, 1, 3]) <= 1.2).all()
    nearest = np.min(np.abs(np.abs(straight[:, 0, 3]) - 8.0))
    assert nearest <= 0.8


def test_icp_brings_all_placements_home(pillars):
    """Across the walls at once, along them as far as the pillars pull."""
    rng = np.random.default_rng(0)
    starts = np.array([moved(*rng.uniform(-0.4, 0.4, 3), rng.uniform(-0.5, 0.5))
                       for _ in range(8)])
    for start, T in zip(starts, icp(pillars, pillars, starts, 5, 20), strict=True):
        assert abs(T[1, 3]) < 0.02
        assert errors(T, np.eye(4))[1] < 0.1
        assert abs(T[0, 3]) < max(0.1, abs(start[0, 3]))


def test_information_of_two_walls(bare):
    """Normals along y only: nothing holds x; the ground holds height, roll and pitch."""
    matrix, lever = information(bare, bare, np.eye(4))
    assert matrix[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert matrix[1, 1] == pytest.approx(1.0)
    assert matrix[2, 2] == pytest.approx(0.3)
    points = bare.points
    assert lever == pytest.approx(np.sqrt((points**2).sum(axis=1).mean()), rel=0.02)
    # turning about z moves a point on the wall by its x, across the wall
    assert matrix[5, 5] == pytest.approx((points[:, 0]**2).mean() / lever**2, rel=0.05)
    weak, _ = weak_directions(bare, bare, np.eye(4))
    assert np.abs(weak[0]) == pytest.approx(ALONG_X, abs=1e-6)


def test_bare_walls_slide_without_end(bare):
    found = hypothesis_test(bare, bare, np.eye(4), np.empty((0, 4, 4)), 30.0)
    assert len(found.degenerate) == 1
    assert np.abs(found.degenerate[0].twist) == pytest.approx(ALONG_X, abs=0.02)
    assert found.degenerate[0].sigma == pytest.approx(30 / np.sqrt(3))
    # but for the slide and half a turn there is nothing else
    for rival in found.competing:
        assert abs(rival[1, 3]) < 0.3
        assert rival[0, 0] == pytest.approx(-1, abs=0.01)


def test_pillars_hold_but_repeat(pillars):
    found = hypothesis_test(pillars, pillars, np.eye(4), np.empty((0, 4, 4)), 30.0)
    assert found.degenerate == ()
    assert errors(found.T_target_source, np.eye(4))[0] < 0.1
    gaps = np.array([errors(T, moved(8.0 * round(T[0, 3] / 8)))[0] for T in found.competing])
    assert (gaps < 0.5).sum() >= 2


def test_what_stands_once_leaves_one_placement():
    """A single pillar on one side, and the gallery is itself in one way only."""
    points, normals = gallery(pitch=200.0, offset=3.0)
    once = view_of(points, normals)
    found = hypothesis_test(once, once, np.eye(4), np.empty((0, 4, 4)), 30.0)
    assert found.degenerate == ()
    assert len(found.competing) == 0


def test_the_better_rival_wins(pillars):
    """An answer a quarter of a pitch off meets the right one among its rivals."""
    found = hypothesis_test(pillars, pillars, moved(4.0), np.array([np.eye(4)]), 30.0)
    offset = found.T_target_source[0, 3]
    assert abs(offset - 8 * round(offset / 8)) < 0.2


@pytest.mark.parametrize('start', [moved(0, 3.0), moved(0, 0, 30.0), moved(500)])
def test_an_answer_that_nothing_speaks_for_is_no_error(bare, start):
    """Beside the walls, above them, far away: there is nothing to compare with."""
    found = hypothesis_test(bare, bare, start, np.empty((0, 4, 4)), 30.0)
    assert found.T_target_source.shape == (4, 4)
    assert found.competing.shape[1:] == (4, 4)


def test_slides_move_and_come_back():
    slide = DegenerateDirection(np.array([0.8, 0.6, 0, 0, 0, 0]), 10.0, 20.0)
    T = moved(3, 1, 0, 30)
    far = perturbed_poses(T, 7 * slide.twist[None])[0]
    assert far[:2, 3] == pytest.approx([3 + 5.6, 1 + 4.2])
    assert slid_back(T, far, (slide,)) == pytest.approx(T)
    aside = perturbed_poses(T, np.array([[-1.2, 1.6, 0, 0, 0, 0.0]]))[0]
    assert slid_back(T, aside, (slide,)) == pytest.approx(aside)


def test_covariance_grows_along_the_slide_and_hardly_aside():
    slide = DegenerateDirection(ALONG_X, 10.0, 20.0)
    grown = inflated(np.eye(6) * 1e-4, (slide,))
    sigma = np.sqrt(np.diag(grown))
    assert sigma[0] == pytest.approx(10.0, rel=1e-3)
    assert sigma[1:3] == pytest.approx([0.1, 0.1], rel=0.01)
    assert (sigma[3:] < 0.012).all()
    assert 'slide along (1.00, 0.00, 0.00)' in in_words((slide,))
    turn = DegenerateDirection(np.array([0, 0, 0, 0, 0, 0.05]), 10.0, 20.0)
    assert 'turn about (0.00, 0.00, 1.00)' in in_words((turn,))


def scans_of(kind, seed, count, low, high, *, labels):
    """Return pairs of scans of a place, and the truth of each: T_target_source."""
    place = scenes.make(kind, seed)
    lidar, rng = Lidar(beams=64, columns=900), np.random.default_rng(seed)
    pairs = []
    for _ in range(count):
        poses = scenes.random_pair(place, rng, low, high)
        scans = [lidar.scan(place, pose, rng) for pose in poses]
        source, target = (SemanticScan(points, ids if labels else None) for points, ids in scans)
        pairs.append((source, target, relative(poses[1], poses[0])))
    return pairs


@pytest.mark.parametrize('labels', [True, False])
@pytest.mark.parametrize('kind', ['tunnel', 'tunnel_lamps_12', 'corridor', 'facade',
                                  'orchard_regular', 'parking_regular'])
def test_nothing_is_certain_where_places_repeat(kind, labels):
    low, high = scenes.KINDS[kind].distances
    for source, target, truth in scans_of(kind, 50, 3, low, high, labels=labels):
        result = register(source, target)
        if result.success:
            metres, degrees = errors(result.T_target_source, truth)
            assert metres < 0.6
            assert degrees < 5
            continue
        assert result.reason
        assert not (result.alternatives and len(result.degenerate))
        if len(result.degenerate):
            T = result.T_target_source
            error = np.concatenate((T[:3, 3] - truth[:3, 3], Rotation.from_matrix(
                T[:3, :3] @ truth[:3, :3].T).as_rotvec()))
            assert error @ np.linalg.solve(result.covariance, error) < BOUND
        elif result.alternatives:
            assert 'ambiguous' in result.reason
            assert result.confidence <= 0.5


@pytest.mark.parametrize('kind', ['field', 'garage_half_full', 'courtyard'])
def test_what_is_unique_is_found(kind):
    for source, target, truth in scans_of(kind, 60, 2, 2.0, 8.0, labels=True):
        result = register(source, target)
        assert result.success, result.reason
        metres, degrees = errors(result.T_target_source, truth)
        assert metres < 0.1
        assert degrees < 0.5


@pytest.mark.parametrize('kind', ['tunnel', 'facade', 'highway'])
def test_different_places_of_one_kind_are_told_apart(kind):
    lidar = Lidar(beams=64, columns=900)
    rng = np.random.default_rng(7)
    indexes = []
    for seed in (70, 71, 72):
        place = scenes.make(kind, seed)
        indexes.append(SemanticScan(*lidar.scan(place, scenes.random_pose(place, rng), rng)))
    for source, target in pairwise(indexes):
        result = register(source, target)
        assert not result.success
