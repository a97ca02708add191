"""Key correspondences and their groups, against plain Python."""
import numpy as np
import pytest
from test_consistency import random_matches

from sgor_ros import SgorConfig
from sgor_ros.core.solver.graph import consistency_graph
from sgor_ros.core.solver.grouping import group
from sgor_ros.core.solver.grouping import leading_eigenvector
from sgor_ros.evaluation import dense_reference as dense


@pytest.mark.parametrize('spacing', [0.0, 5.0, 15.0, 20.0])
def test_keys_are_the_strongest_that_are_far_enough_apart(spacing):
    """As a plain loop takes them; where the spacing runs out, the strongest that were left."""
    matches, _ = random_matches(400, 0.3, 0)
    config = SgorConfig(groups=100, group_size=30, key_spacing=spacing)
    graph = consistency_graph(matches, config)
    order = np.argsort(-leading_eigenvector(graph), kind='stable')
    keys = group(matches, graph, config).keys
    assert keys.tolist() == dense.spread(matches.source, order, 100, spacing)
    gaps = np.linalg.norm(matches.source[keys][:, None] - matches.source[keys], axis=-1)
    gaps[np.arange(100), np.arange(100)] = np.inf
    if spacing == 5.0:
        assert gaps.min() >= spacing
    if spacing == 20.0:    # not even 100 balls of 20 m fit here
        assert gaps.min() < spacing


def test_right_matches_are_the_first_keys():
    """Spectral matching puts the consistent third before the random rest."""
    matches, T = random_matches(600, 0.3, 1)
    config = SgorConfig(groups=100)
    keys = group(matches, consistency_graph(matches, config), config).keys
    residual = np.linalg.norm(
        matches.source @ T[:3, :3].T + T[:3, 3] - matches.target, axis=1)
    assert (residual[keys] < 0.5).mean() > 0.95


def members_of(groups, points):
    """Return the group of each key as a list of indices."""
    squared = ((points[groups.keys][:, None] - points) ** 2).sum(axis=-1)
    return [np.flatnonzero(row <= reach * (1 + 1e-12)).tolist()
            for row, reach in zip(squared, groups.squared_reach, strict=True)]


@pytest.mark.parametrize('size', [3 + 1, 50, 10000])
def test_groups_are_the_nearest_on_the_source(size):
    """k nearest by brute force, the key among them; never more than there are."""
    matches, _ = random_matches(200, 0.3, 2)
    config = SgorConfig(groups=20, group_size=size, group_keep=3)
    groups = group(matches, consistency_graph(matches, config), config)
    for key, members in zip(groups.keys, members_of(groups, matches.source), strict=True):
        distance = np.linalg.norm(matches.source - matches.source[key], axis=1)
        assert key in members
        assert len(members) == min(size, 200)
        assert set(members) == set(np.argsort(distance, kind='stable')[:size])


def test_matches_of_one_place_are_all_in_its_groups():
    """All distances alike: none is farther than the k-th."""
    matches, _ = random_matches(30, 1.0, 4)
    matches.source[:] = matches.source[0]
    config = SgorConfig(groups=5, group_size=10, group_keep=3)
    groups = group(matches, consistency_graph(matches, config), config)
    assert all(members == list(range(30)) for members in members_of(groups, matches.source))


def test_fewer_matches_than_groups():
    """Every match is a key once, and in every group."""
    matches, _ = random_matches(12, 1.0, 3)
    config = SgorConfig(groups=200)
    groups = group(matches, consistency_graph(matches, config), config)
    assert sorted(groups.keys) == list(range(12))
    assert all(members == list(range(12)) for members in members_of(groups, matches.source))
