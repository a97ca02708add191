"""Edges end to end, against errors that are drawn."""
import numpy as np
import pytest

from sgor_ros.core.common import se3
from sgor_ros.mapping.edge import chained
from sgor_ros.mapping.edge import Edge
from sgor_ros.mapping.edge import squared_distance

DRAWS = 4000
# of the mean of so many values of chi squared with 6 degrees of freedom
SPREAD = np.sqrt(2 * 6 / DRAWS)


def some_edge(rng, target, source):
    root = np.diag([0.03, 0.01, 0.02, 0.002, 0.001, 0.003]) @ (
        np.eye(6) + 0.4 * rng.normal(size=(6, 6)))
    T = se3.compose(se3.rotations(rng.normal(0, 0.7, 3)), rng.normal(0, 5, 3))
    return Edge(target, source, T, root @ root.T)


def drawn(rng, edge):
    """Return a true pose whose measurement may have been that of the edge."""
    by = np.linalg.cholesky(edge.covariance) @ rng.normal(size=6)
    return se3.perturbed(edge.T_target_source, by)


def test_a_chain_has_the_covariance_of_errors_that_add_up():
    rng = np.random.default_rng(0)
    edges = [some_edge(rng, i, i + 1) for i in range(4)]
    T, covariance = chained(edges)
    expected = np.linalg.multi_dot([edge.T_target_source for edge in edges])
    np.testing.assert_allclose(T, expected, atol=1e-12)
    charged = [squared_distance(np.linalg.multi_dot([drawn(rng, edge) for edge in edges]), T,
                                covariance) for _ in range(DRAWS)]
    assert np.mean(charged) == pytest.approx(6, abs=5 * SPREAD)


def test_an_edge_seen_from_its_source_has_the_covariance_that_it_has_there():
    rng = np.random.default_rng(1)
    edge = some_edge(rng, 3, 8)
    back = edge.reversed()
    assert (back.target, back.source) == (8, 3)
    charged = [squared_distance(se3.inverse(drawn(rng, edge)), back.T_target_source,
                                back.covariance) for _ in range(DRAWS)]
    assert np.mean(charged) == pytest.approx(6, abs=5 * SPREAD)
    again = back.reversed()
    np.testing.assert_allclose(again.T_target_source, edge.T_target_source, atol=1e-12)
    np.testing.assert_allclose(again.covariance, edge.covariance, atol=1e-12)


def test_no_edges_lead_nowhere():
    T, covariance = chained([])
    np.testing.assert_array_equal(T, np.eye(4))
    np.testing.assert_array_equal(covariance, 0)
