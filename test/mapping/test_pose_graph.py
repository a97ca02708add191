"""The pose graph: against what can be computed by hand, and against loops that are wrong."""
import numpy as np
import pytest

from sgor_ros.core.common import se3
from sgor_ros.io.g2o import write_g2o
from sgor_ros.io.g2o import write_stamps
from sgor_ros.mapping.edge import Edge
from sgor_ros.mapping.edge import Kind
from sgor_ros.mapping.pose_graph import PoseGraph

gtsam = pytest.importorskip('gtsam')


def shift(*xyz):
    return se3.compose(np.eye(3), np.array(xyz, float))


def pose(yaw, *xyz):
    return se3.compose(se3.rotations(np.array([0, 0, yaw])), np.array(xyz, float))


def chain(*steps, first=10, covariance=None):
    """Return a graph of nodes 10, 11, ... and a step between each two."""
    graph = PoseGraph()
    graph.add_origin(first, np.eye(4))
    for i, step in enumerate(steps):
        graph.add_node(Edge(first + i, first + i + 1, step,
                            np.eye(6) if covariance is None else covariance))
    return graph


def test_a_loop_shares_its_error_by_the_variances():
    """Steps of 1 m, a loop that says 2.3 m: 0.3 m to share among variances 1, 1 and 4."""
    graph = chain(shift(1, 0, 0), shift(1, 0, 0))
    graph.close([Edge(10, 12, shift(2.3, 0, 0), 4 * np.eye(6), Kind.LOOP)])
    np.testing.assert_allclose(graph.poses([10, 11, 12])[:, 0, 3], [0, 1.05, 2.1], atol=1e-6)
    chi_squared, freedom = graph.chi_squared()
    # 0.05 m twice with variance 1, 0.2 m with variance 4
    assert chi_squared == pytest.approx(0.05**2 + 0.05**2 + 0.2**2 / 4, rel=1e-4)
    assert freedom == 6


def test_covariances_of_gtsam_are_those_of_the_target_frame():
    """A sensor turned by 90 degrees: what is unsure along the target's x is along its own -y."""
    covariance = np.diag([1.0, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6])
    graph = chain(pose(np.pi / 2, 5, 0, 0), covariance=covariance)
    graph.close([Edge(10, 11, pose(np.pi / 2, 6, 0, 0), 1e-2 * np.eye(6), Kind.LOOP)])
    # x follows the loop by 1 / 1.01 of the way
    np.testing.assert_allclose(graph.pose(11), pose(np.pi / 2, 5 + 1 / 1.01, 0, 0), atol=1e-4)


def test_two_parts_are_joined_by_a_loop_whatever_way_round():
    for swap in (False, True):
        graph = chain(shift(1, 0, 0))
        graph.add_origin(20, np.eye(4))
        graph.add_node(Edge(20, 21, shift(0, 2, 0), np.eye(6)))
        assert graph.part(21) != graph.part(11)
        assert graph.chi_squared()[1] == 0
        loop = Edge(11, 20, pose(3.0, 0, 4, 0), np.eye(6), Kind.LOOP)
        graph.close([loop.reversed() if swap else loop])
        assert graph.part(21) == graph.part(10) == graph.part(20)
        expected = shift(1, 0, 0) @ pose(3.0, 0, 4, 0) @ shift(0, 2, 0)
        np.testing.assert_allclose(graph.pose(21), expected, atol=1e-6)
        graph.add_node(Edge(21, 22, shift(1, 0, 0), np.eye(6)))
        np.testing.assert_allclose(graph.pose(22), expected @ shift(1, 0, 0), atol=1e-6)


@pytest.fixture
def rounds():
    """Return a graph of two rounds with noise, its right loops and its true poses."""
    rng = np.random.default_rng(0)
    sigma = np.array([0.02] * 3 + [0.002] * 3)
    true = [pose(a, 30 * np.cos(a), 30 * np.sin(a), 0) for a in np.arange(80) * 2 * np.pi / 40]
    true = [se3.inverse(true[0]) @ T for T in true]

    def measured(a, b, kind):
        T = se3.perturbed(se3.inverse(true[a]) @ true[b], rng.normal(0, sigma))
        return Edge(a, b, T, np.diag(sigma**2), kind)

    graph = PoseGraph()
    graph.add_origin(0, np.eye(4))
    for i in range(79):
        graph.add_node(measured(i, i + 1, Kind.ODOMETRY))
    return graph, [measured(i - 40, i, Kind.LOOP) for i in range(42, 80, 2)], np.array(true)


def test_right_loops_cost_what_their_covariances_say(rounds):
    graph, loops, true = rounds
    before = np.linalg.norm(graph.poses(range(80))[:, :3, 3] - true[:, :3, 3], axis=1).max()
    for loop in loops:
        graph.close([loop])
    after = np.linalg.norm(graph.poses(range(80))[:, :3, 3] - true[:, :3, 3], axis=1).max()
    assert after < 0.5 * before
    chi_squared, freedom = graph.chi_squared()
    assert freedom == 6 * len(loops)
    assert 0.7 < chi_squared / freedom < 1.4


def test_ten_false_loops_are_found_and_left_out(rounds):
    graph, loops, _ = rounds
    graph.close(loops)
    poses = graph.poses(range(80))
    rng = np.random.default_rng(1)
    false = [Edge(a, a + 35, pose(*rng.uniform([-3, -20, -20, 0], [3, 20, 20, 0])),
                  1e-4 * np.eye(6), Kind.LOOP) for a in range(0, 40, 4)]
    graph.close(false)
    ruined = np.linalg.norm(graph.poses(range(80))[:, :3, 3] - poses[:, :3, 3], axis=1).max()
    assert ruined > 1
    kept = graph.without_outliers(graph.loops)
    assert [id(loop) for loop in kept] == [id(loop) for loop in loops]
    graph.replace_loops(kept)
    moved = np.linalg.norm(graph.poses(range(80))[:, :3, 3] - poses[:, :3, 3], axis=1).max()
    assert moved < 0.001


def test_two_foreign_readers_read_the_graph(rounds, tmp_path):
    """Both charge for the edges what the graph says."""
    g2o = pytest.importorskip('g2opy')
    graph, loops, _ = rounds
    graph.close(loops)
    chi_squared, _ = graph.chi_squared()
    poses = {node: graph.pose(node) for node in graph.nodes}
    write_g2o(tmp_path / 'graph.g2o', poses, graph.edges)
    write_stamps(tmp_path / 'stamps.txt', {node: 10**18 + node for node in poses})

    optimizer = g2o.SparseOptimizer()
    assert optimizer.load(str(tmp_path / 'graph.g2o'))
    assert len(optimizer.vertices()) == 80
    charged = 0.0
    for edge in optimizer.edges():
        edge.compute_error()
        charged += edge.chi2()
    assert charged == pytest.approx(chi_squared, rel=0.01)

    factors, values = gtsam.readG2o(str(tmp_path / 'graph.g2o'), True)
    assert factors.size() == len(graph.edges)
    np.testing.assert_allclose([values.atPose3(node).matrix() for node in poses],
                               list(poses.values()), atol=1e-9)
    assert (tmp_path / 'stamps.txt').read_text().splitlines()[79] == f'79 {10**18 + 79}'
