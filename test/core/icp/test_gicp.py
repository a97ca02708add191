"""Local refinement on the clouds, and its covariance."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import SgorConfig
from sgor_ros.core.icp.covariance import correlated_error
from sgor_ros.core.icp.gicp import align
from sgor_ros.core.index.surface import surface
from sgor_ros.core.scan.voxels import voxel_grid


@pytest.fixture(scope='module')
def clouds(street):
    """Return thinned points of two street scans and T_target_source."""
    target, source = (voxel_grid(points, np.zeros(len(points), np.uint8), 0.5).points
                      for points, _, _ in street[:2])
    return source, target, relative(street[0][2], street[1][2])


def motion(x, y, z, yaw_deg, pitch_deg=0.0):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler('zy', [yaw_deg, pitch_deg], degrees=True).as_matrix()
    T[:3, 3] = x, y, z
    return T


def aligned(source, target, start, origins=((0, 0, 0), (0, 0, 0))):
    """Return the alignment of clouds that were seen from these places."""
    return align(*(surface(points, 0.5, np.array(origin, np.float64))
                   for points, origin in zip((source, target), origins, strict=True)),
                 start, SgorConfig())


def noise(found):
    """Return the part of the covariance that comes from the pairs."""
    return found.covariance - found.correlated_error @ found.correlated_error.T


@pytest.mark.parametrize('offset', [motion(0.1, -0.1, 0.05, 0.3),
                                    motion(-0.15, 0.1, 0.0, -0.4, 0.2)])
def test_a_small_motion_is_found(clouds, offset):
    """From some decimetres and tenths of a degree off to centimetres."""
    source, target, truth = clouds
    found = aligned(source, target, truth @ offset)
    metres, degrees = errors(found.T_target_source, truth)
    assert found.converged
    assert found.pairs > 1000
    assert metres < 0.03
    assert degrees < 0.1


def test_covariance_is_one(clouds):
    """Symmetric, positive definite, centimetres and not metres; z of a street is well held."""
    source, target, truth = clouds
    found = aligned(source, target, truth).covariance
    np.testing.assert_allclose(found, found.T, rtol=1e-9, atol=1e-15)
    assert np.linalg.eigvalsh(found).min() > 0
    sigma = np.sqrt(np.diag(found))
    assert (sigma[:3] < 0.1).all()
    assert (sigma[:3] > 1e-4).all()
    assert (np.degrees(sigma[3:]) < 0.2).all()


@pytest.mark.parametrize('move', [
    motion(0, 0, 0, 70), motion(100, -40, 7, 0), motion(-30, 20, 1, 140, 30)])
def test_covariance_turns_with_the_target_frame(clouds, move):
    """The same problem seen from a moved target: each 3x3 block turns, nothing else happens."""
    source, target, truth = clouds
    plain = aligned(source, target, truth)
    moved = aligned(source, target @ move[:3, :3].T + move[:3, 3], move @ truth,
                    ((0, 0, 0), move[:3, 3]))
    np.testing.assert_allclose(moved.T_target_source, move @ plain.T_target_source, atol=2e-3)
    turn = np.kron(np.eye(2), move[:3, :3])
    expected = turn @ noise(plain) @ turn.T
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(noise(moved) / scale, expected / scale, atol=0.03)


def test_covariance_is_of_the_source_frame_in_the_target(clouds):
    """Moving the source's origin by a lever gives the covariance of that lever's end."""
    source, target, truth = clouds
    plain = aligned(source, target, truth)
    shift = motion(-20, 8, 2, 0)
    moved = aligned(source @ shift[:3, :3].T + shift[:3, 3], target, truth @ np.linalg.inv(shift),
                    (shift[:3, 3], (0, 0, 0)))
    x, y, z = truth[:3, :3] @ np.linalg.inv(shift)[:3, 3]
    carry = np.eye(6)
    carry[:3, 3:] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    expected = carry @ noise(plain) @ carry.T
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(noise(moved) / scale, expected / scale, atol=0.05)


def test_a_plane_leaves_directions_open():
    """Two looks at a wall say nothing of the motion along it: its variance tells."""
    rng = np.random.default_rng(0)
    wall = np.c_[rng.normal(8, 0.01, 2000), rng.uniform(-10, 10, 2000), rng.uniform(0, 6, 2000)]
    again = np.c_[rng.normal(8, 0.01, 2000), rng.uniform(-10, 10, 2000), rng.uniform(0, 6, 2000)]
    sigma = np.sqrt(np.diag(noise(aligned(wall, again, np.eye(4)))))
    assert sigma[1:3].min() > 10 * sigma[0]


def test_few_points_have_no_surface():
    assert surface(np.ones((9, 3)), 0.5) is None
    assert surface(np.empty((0, 3)), 0.5) is None


def test_clouds_without_overlap_end_without_a_covariance(clouds):
    source, target, _ = clouds
    found = aligned(source, target, motion(1000, 0, 0, 0))
    assert found.pairs == 0
    assert found.covariance is None


def test_systematic_errors_grow_with_the_motion_up_to_an_edge_of_the_grid():
    """None at rest; along the motion most; a turn counts as the way of what is seen by it."""
    def sigma(T):
        root = correlated_error(T, middle_range=20.0, edge=0.5)
        return np.sqrt(np.diag(root @ root.T))

    assert not sigma(np.eye(4)).any()
    short, edge, far = (sigma(motion(x, 0, 0, 0)) for x in (0.1, 0.5, 30.0))
    np.testing.assert_allclose(edge, 5 * short)
    np.testing.assert_allclose(far, edge)
    assert edge[0] > 5 * edge[1] > 0
    np.testing.assert_allclose(sigma(motion(0, -0.5, 0, 0))[[1, 0, 2]], edge[:3])
    np.testing.assert_allclose(sigma(motion(0, 0, 0, np.degrees(0.1 / 20)))[3:], short[3:])
