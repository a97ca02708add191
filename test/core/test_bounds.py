"""Whatever cloud comes, time and memory are bounded: counted here, not timed."""
import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.features import neighbours
from sgor_ros.core.features.features import Features
from sgor_ros.core.features.neighbours import radius_neighbours
from sgor_ros.core.matching import correspondences
from sgor_ros.core.matching.correspondences import Correspondences
from sgor_ros.core.matching.correspondences import match
from sgor_ros.core.solver import graph as graph_module
from sgor_ros.core.solver.graph import consistency_graph
from sgor_ros.core.verdict.result import Status


def noise(n, size, seed=0):
    return np.random.default_rng(seed).uniform(-size / 2, size / 2, (n, 3))


def test_voxels_are_thinned_evenly():
    """To the count set, over the whole cloud; a scan that has no more is left as it is."""
    scan = SemanticScan(noise(100000, 60))
    config = SgorConfig(max_voxels=5000)
    prepared = preprocess(scan, config)
    points = prepared.features.points
    assert len(points) <= 5000
    assert any('voxels thinned to 5000' in warning for warning in prepared.warnings)
    octants = np.bincount((points > 0) @ [1, 2, 4], minlength=8)
    assert octants.min() > 0.9 * len(points) / 8
    small = SemanticScan(noise(4000, 60))
    np.testing.assert_array_equal(preprocess(small, config).features.points,
                                  preprocess(small).features.points)


@pytest.mark.parametrize('most', [10**9, 300_000])
def test_neighbours_of_a_dense_cloud_are_an_even_share(monkeypatch, most):
    """No more than looked at; each of them a neighbour, itself the first, all there if few."""
    monkeypatch.setattr(neighbours, 'MOST_CANDIDATES', most)
    points = noise(2000, 8)
    found = radius_neighbours(points, 2.0)
    gap = np.linalg.norm(points[:, None] - points, axis=-1)
    true = gap <= 2.0
    assert len(found.index) <= most + 9 * len(points)    # a run of cells gives one at least
    if most == 10**9:
        assert len(found.index) == true.sum()
    counts = np.diff(found.start.astype(int))
    for i in range(0, 2000, 50):
        row = found.index[found.start[i]:found.start[i + 1]]
        assert row[0] == i
        assert len(np.unique(row)) == len(row)
        assert true[i, row].all()
        np.testing.assert_allclose(found.squared[found.start[i]:found.start[i + 1]],
                                   gap[i, row]**2, rtol=1e-5)
    # the share is the same in the thick and at the edge
    share = counts / true.sum(axis=1)
    inner = np.abs(points).max(axis=1) < 2
    assert share[inner].mean() == pytest.approx(share[~inner].mean(), rel=0.1)


def test_matching_compares_no_more_than_it_can_afford(monkeypatch):
    """Fewer source points are matched, evenly taken, each as it was."""
    rng = np.random.default_rng(0)
    sides = [Features(rng.uniform(-9, 9, (n, 3)), *np.zeros((2, n), np.uint8),
                      rng.random((n, 33)).astype(np.float32)) for n in (300, 200)]
    every = match(*sides, SgorConfig())
    monkeypatch.setattr(correspondences, 'MOST_COMPARISONS', 100 * 200)
    some = match(*sides, SgorConfig())
    assert (len(every), len(some)) == (300, 100)
    rows = [int(np.flatnonzero((every.source == p).all(axis=1))[0]) for p in some.source]
    np.testing.assert_array_equal(some.target, every.target[rows])
    assert np.diff(rows).max() <= 4


def test_the_graph_has_no_more_edges_than_fit(monkeypatch):
    """All matches right, so all consistent: the graph is that of some of them, evenly spread."""
    points = noise(900, 40)
    none = np.zeros(900, np.uint8)
    matches = Correspondences(points, points + [1, 2, 3], none, none, none, none)
    assert len(consistency_graph(matches, SgorConfig()).index) == 900**2
    monkeypatch.setattr(graph_module, 'MOST_EDGES', 100_000)
    graph = consistency_graph(matches, SgorConfig())
    rows = np.diff(graph.start.astype(int))
    nodes = np.flatnonzero(rows)
    assert len(graph.index) == len(nodes)**2 <= 100_000
    assert len(nodes) > 280
    assert np.diff(nodes).max() <= 4
    np.testing.assert_array_equal(np.unique(graph.index), nodes)


def test_a_bounded_graph_still_finds_all_inliers(monkeypatch):
    """The matches without edges, seven of eight, take part in the refinement."""
    scan = SemanticScan(noise(2000, 40) + [60, 0, 0])
    config = SgorConfig(quick_keypoints=0)
    free = register(scan, scan, config)
    monkeypatch.setattr(graph_module, 'MOST_EDGES', 50_000)
    bounded = register(scan, scan, config)
    assert bounded.success
    assert bounded.inliers.sum() == free.inliers.sum() > 1000


SHAPES = {
    'a cube': noise(200000, 100), 'a block': noise(200000, 20),
    'one voxel': noise(200000, 0.2) + 5.25, 'a line': noise(200000, 1) * [140, 0, 0] + [0, 2, 1],
    'a wall': noise(200000, 100) * [0, 1, 1] + [5, 0, 0],
    'a lattice': np.stack(np.meshgrid(*[np.arange(58) - 28.75] * 3), -1).reshape(-1, 3),
}


@pytest.mark.parametrize('shape', SHAPES)
def test_no_shape_takes_more_than_the_bounds(monkeypatch, street, shape):
    """A refusal in words, and counts below the bounds, against a street and themselves."""
    monkeypatch.setattr(neighbours, 'MOST_CANDIDATES', 2_000_000)
    config = SgorConfig(max_voxels=10000)
    points, labels, _ = street[0]
    strange = preprocess(SemanticScan(SHAPES[shape]), config)
    found = radius_neighbours(strange.features.points, config.descriptor_radius)
    assert len(strange.features.points) <= 10000
    assert len(found.index) <= 2_000_000 + 9 * 10000
    turned = preprocess(SemanticScan(SHAPES[shape] @ np.array([[0, -1, 0], [0.8, 0, -0.6],
                                                               [0.6, 0, 0.8]])), config)
    for other in (preprocess(SemanticScan(points, labels), config), turned):
        result = register(strange, other, config)
        assert result.status is Status.NO_SOLUTION
