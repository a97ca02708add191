"""What surfaces hold of a pose, by hand: walls, a floor, a corner, a round shaft."""
from galleries import gallery
from galleries import index_of
from galleries import moved
import numpy as np
import pytest

from sgor_ros.core.degeneracy.localizability import information
from sgor_ros.core.degeneracy.localizability import weak_directions

X, Y, Z = np.eye(3)


def wall(normal, away, size=6.0, step=0.5):
    """Return a square wall `away` metres from the sensor that faces it by a unit normal."""
    u = np.cross(normal, Z if abs(normal[2]) < 0.5 else X)
    v = np.cross(normal, u)
    a, b = np.meshgrid(np.arange(-size, size + step / 2, step), np.arange(-size, size + step / 2,
                                                                          step))
    points = -away * np.asarray(normal) + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    return points, np.tile(normal, (len(points), 1))


def scene(*walls, up=Z):
    return index_of(*(np.concatenate(parts) for parts in zip(*walls, strict=True)), up=up)


def test_information_of_one_wall_by_hand():
    """What a wall across x holds: x, and turns about y and z as far as its points lie out."""
    points, normals = wall(-X, 8.0)
    index = scene((points, normals), up=None)
    matrix, lever = information(index, index, np.eye(4))
    assert lever == pytest.approx(np.sqrt((points**2).sum(axis=1).mean()))
    out = (points[:, 1]**2).mean()
    expected = np.diag([1, 0, 0, 0, out / lever**2, out / lever**2])
    np.testing.assert_allclose(matrix, expected, atol=1e-9)


def test_the_ground_adds_height_roll_and_pitch():
    index = scene(wall(-X, 8.0))
    free = scene(wall(-X, 8.0), up=None)
    more = information(index, index, np.eye(4))[0] - information(free, free, np.eye(4))[0]
    np.testing.assert_allclose(more, np.diag([0, 0, 0.3, 0.3, 0.3, 0]), atol=1e-9)
    # both have to see it
    for pair in ((index, free), (free, index)):
        np.testing.assert_allclose(information(*pair, np.eye(4))[0],
                                   information(free, free, np.eye(4))[0], atol=1e-9)


def test_information_is_about_the_source_in_the_target_frame():
    """A source turned by 90 degrees and 2 m nearer sees the wall ahead where y was."""
    points, normals = wall(-X, 8.0)
    target = scene((points, normals), up=None)
    T = moved(2.0, yaw_deg=90.0)
    source = index_of((points - [2, 0, 0]) @ T[:3, :3], normals @ T[:3, :3], up=None)
    matrix, lever = information(source, target, T)
    arms = points - [2, 0, 0]
    assert lever == pytest.approx(np.sqrt((arms**2).sum(axis=1).mean()))
    assert matrix[0, 0] == pytest.approx(1.0)
    assert matrix[5, 5] == pytest.approx((arms[:, 1]**2).mean() / lever**2)
    assert matrix[0, 5] == pytest.approx(0.0, abs=1e-9)


def test_the_arm_of_a_wall_beside_couples_shift_and_turn():
    """All of a wall ahead and to the left: turning left is coming nearer."""
    points, normals = wall(-X, 8.0)
    points = points + [0, 10, 0]
    index = index_of(points, normals, up=None)
    matrix, lever = information(index, index, np.eye(4))
    # n = -x, arm x n has z = 10: the row is (-1, 0, 0, ..., 10 / lever)
    assert matrix[0, 5] == pytest.approx(-(points[:, 1].mean()) / lever)
    assert matrix[5, 0] == pytest.approx(matrix[0, 5])


def test_without_partners_nothing_is_held():
    index = scene(wall(-X, 8.0))
    matrix, lever = information(index, index, moved(500.0))
    np.testing.assert_array_equal(matrix, np.zeros((6, 6)))
    assert lever == 1.0
    weak, lever = weak_directions(index, index, moved(500.0))
    assert weak.shape == (6, 6)
    assert lever == 1.0


@pytest.mark.parametrize(('walls', 'directions'), [
    ([wall(-X, 8.0), wall(-Y, 8.0)], []),                        # a corner, on the ground
    ([wall(-Y, 4.0), wall(Y, 4.0)], [X]),                        # two walls
    ([wall(-X, 8.0)], [Y])])                                     # one across
def test_walls_leave_free_what_lies_along_them(walls, directions):
    index = scene(*walls)
    weak, lever = weak_directions(index, index, np.eye(4))
    # 1,000 of the points are asked
    assert lever == pytest.approx(np.sqrt((index.points**2).sum(axis=1).mean()), rel=2e-3)
    assert len(weak) == len(directions)
    for twist, axis in zip(weak, directions, strict=True):
        np.testing.assert_allclose(np.abs(twist), [*axis, 0, 0, 0], atol=1e-6)


def test_a_round_shaft_leaves_its_turn_free():
    """All normals cross the axis: a turn about it moves each point by a metre at the lever."""
    angle, z = np.meshgrid(np.arange(0, 2 * np.pi, 0.05), np.arange(-3, 3.1, 0.5))
    out = np.stack((np.cos(angle), np.sin(angle), 0 * z), -1).reshape(-1, 3)
    shaft = index_of(8 * out + np.c_[0 * z.ravel(), 0 * z.ravel(), z.ravel()], -out)
    weak, lever = weak_directions(shaft, shaft, np.eye(4))
    assert len(weak) == 1
    np.testing.assert_allclose(np.abs(weak[0]), [0, 0, 0, 0, 0, 1 / lever], atol=1e-6)
    # lying, without a ground plane, and long: along x, and about it
    long = np.concatenate([shaft.points + [0, 0, z] for z in (-12, -6, 0, 6, 12)])
    lying = index_of(long[:, [2, 0, 1]], np.tile(shaft.normals[:, [2, 0, 1]], (5, 1)), up=None)
    weak, lever = weak_directions(lying, lying, np.eye(4))
    assert len(weak) == 2
    found = weak * np.repeat((1.0, lever), 3)
    np.testing.assert_allclose(np.linalg.norm(found, axis=0), [1, 0, 0, 1, 0, 0], atol=1e-4)


@pytest.mark.parametrize(('share', 'count'), [(0.05, 1), (0.15, 0)])
def test_a_direction_is_weak_below_a_tenth_of_the_points(share, count):
    """Two walls, and this share of points on pillars that face along them."""
    points, normals = gallery(pitch=0.0)
    rng = np.random.default_rng(0)
    facing = rng.random(len(points)) < share
    normals = np.where(facing[:, None], X, normals)
    index = index_of(points, normals)
    weak, _ = weak_directions(index, index, np.eye(4))
    assert len(weak) == count
