"""Old nodes go; what they joined stays joined, by no more than was known."""
import numpy as np
import pytest

from sgor_ros.core.common import se3
from sgor_ros.mapping.edge import Edge
from sgor_ros.mapping.edge import Kind
from sgor_ros.mapping.pose_graph import PoseGraph
from sgor_ros.mapping.trimming import edges_without
from sgor_ros.mapping.trimming import NEWEST
from sgor_ros.mapping.trimming import too_many

STEP = np.eye(4)
STEP[0, 3] = 2.0


def along(metres):
    T = np.eye(4)
    T[0, 3] = metres
    return T


def edge(target, source, metres, variance, kind=Kind.ODOMETRY):
    """Return one between nodes on a line, whose turns are known well."""
    return Edge(target, source, along(metres),
                np.diag([variance] * 3 + [variance * 1e-9] * 3), kind)


@pytest.fixture
def graph():
    """Return a map 0, 1, 2 and a drive 10 to 14 along it, 2 m each, with loops at 11 and 13."""
    graph = PoseGraph()
    graph.add_map({node: along(2.0 * node) for node in range(3)},
                  [edge(0, 1, 2.0, 0.04), edge(1, 2, 2.0, 0.04)])
    graph.add_origin(10, along(0.0))
    for node in range(11, 15):
        graph.add_node(edge(node - 1, node, 2.0, 0.01))
    graph.edges += [edge(1, 11, 0.0, 0.05, Kind.LOOP), edge(2, 13, 2.0, 0.06, Kind.LOOP)]
    graph.keep(graph.nodes, graph.edges)    # with the loops, unoptimised
    return graph


def ends_of(edges):
    return [(one.target, one.source, one.kind.value) for one in edges]


def test_a_way_through_nodes_that_go_becomes_one_edge(graph):
    edges = edges_without(graph, {10, 11, 12, 13})
    assert ends_of(edges) == [(0, 1, 'odometry'), (1, 2, 'odometry'), (2, 14, 'loop')]
    bridge = edges[-1]
    # by the loop of 13 it is 0.06 + 0.01 m^2, by that of 11 0.05 + 0.03
    np.testing.assert_allclose(bridge.T_target_source, along(4.0), atol=1e-12)
    np.testing.assert_allclose(np.diag(bridge.covariance)[:3], 0.07, rtol=1e-3)


def test_nodes_that_are_joined_without_get_no_edge(graph):
    """13 has a loop of its own."""
    edges = edges_without(graph, {10, 11, 12})
    assert ends_of(edges) == [(0, 1, 'odometry'), (1, 2, 'odometry'), (2, 13, 'loop'),
                              (13, 14, 'odometry')]


def test_by_odometry_alone_it_is_an_odometry_edge():
    graph = PoseGraph()
    graph.add_origin(0, np.eye(4))
    for node in range(1, 5):
        graph.add_node(edge(node - 1, node, 2.0, 0.01))
    edges = edges_without(graph, {1, 2})
    assert ends_of(edges) == [(0, 3, 'odometry'), (3, 4, 'odometry')]
    np.testing.assert_allclose(np.diag(edges[0].covariance)[:3], 0.03, rtol=1e-6)
    graph.keep([0, 3, 4], edges)
    np.testing.assert_allclose(graph.poses([0, 3, 4])[:, 0, 3], [0, 6, 8])
    np.testing.assert_allclose(graph.poses_by_odometry([0, 3, 4])[:, 0, 3], [0, 6, 8])


def test_a_part_that_nothing_joins_stays_apart(graph):
    graph.add_origin(20, along(50.0))
    graph.add_node(edge(20, 21, 2.0, 0.01))
    going = {10, 11, 12, 13, 20}
    edges = edges_without(graph, going)
    assert 21 not in {end for one in edges for end in (one.target, one.source)}
    graph.keep([node for node in graph.nodes if node not in going], edges)
    assert graph.part(14) == graph.part(0) != graph.part(21)
    np.testing.assert_allclose(graph.pose(21), along(52.0))


def test_where_one_way_led_through_them_nothing_is_lost(graph):
    """The next loop moves the graph as it would have moved the whole."""
    pytest.importorskip('gtsam')
    stay, going = [0, 1, 2, 13, 14], {10, 11, 12}
    whole, trimmed = PoseGraph(), PoseGraph()
    edges = [one for one in graph.edges if one.source != 13 or one.kind is Kind.ODOMETRY]
    for one in (whole, trimmed):
        one.add_map({node: graph.pose(node) for node in graph.nodes}, edges)
    trimmed.keep(stay, edges_without(trimmed, going))
    np.testing.assert_array_equal(trimmed.poses(stay), graph.poses(stay))
    for one in (whole, trimmed):
        one.close([edge(2, 14, 4.3, 0.02, Kind.LOOP)])
    assert whole.pose(14)[0, 3] > 8.1
    np.testing.assert_allclose(trimmed.poses(stay), whole.poses(stay), atol=1e-6)


def test_nobody_goes_until_there_are_twice_as_many():
    graph = PoseGraph()
    graph.add_origin(0, np.eye(4))
    for node in range(1, 2 * NEWEST + 3):
        assert too_many(graph, {0, 5}) == []
        graph.add_node(edge(node - 1, node, 2.0, 0.01))
    going = too_many(graph, {0, 5})
    assert going == [*range(1, 5), *range(6, NEWEST + 3)]
    assert len(graph) - 2 - len(going) == NEWEST


def test_paths_may_turn(graph):
    """A bridge lies where the graph has both of its ends."""
    turn = se3.exp(np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.7]))
    graph.add_node(Edge(14, 15, turn, 1e-4 * np.eye(6)))
    graph.add_node(Edge(15, 16, turn, 1e-4 * np.eye(6)))
    edges = edges_without(graph, {15})
    bridge, = (one for one in edges if one.source == 16)
    assert bridge.target == 14
    np.testing.assert_allclose(bridge.T_target_source, turn @ turn, atol=1e-12)
