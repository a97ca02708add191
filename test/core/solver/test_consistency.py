"""The sparse compiled path against the dense reference of the paper's equations."""
import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import register_correspondences
from sgor_ros import SgorConfig
from sgor_ros.core.matching.correspondences import Correspondences
from sgor_ros.core.solver.consistency import filter_groups
from sgor_ros.core.solver.consistency import label_agreement
from sgor_ros.core.solver.graph import consistency_graph
from sgor_ros.core.solver.grouping import group
from sgor_ros.core.solver.grouping import leading_eigenvector
from sgor_ros.evaluation import dense_reference as dense

CUTOFFS = (1.0, 6.0)
PAPER = SgorConfig.paper()


def random_matches(n, share, seed, labels=4):
    """Return Correspondences of which a share is right, and T_target_source."""
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = rng.uniform(-20, 20, 3)
    source = rng.uniform(-40, 40, (n, 3))
    target = source @ T[:3, :3].T + T[:3, 3] + rng.normal(0, 0.05, (n, 3))
    wrong = rng.permutation(n)[:round(n * (1 - share))]
    target[wrong] = rng.uniform(-40, 40, (len(wrong), 3))
    s, t, s2, t2 = rng.integers(1, labels, (4, n)).astype(np.uint8)
    return Correspondences(source, target, s, t, s2, t2), T


def real_matches(folder, name):
    """Return Correspondences of a KITTI set and T_target_source."""
    source = np.loadtxt(folder / f'correspondences/kitti_{name}_source.txt')
    target = np.loadtxt(folder / f'correspondences/kitti_{name}_target.txt')
    T = np.loadtxt(folder / f'correspondences/kitti_{name}_T_target_source.txt').reshape(-1, 4)
    labels = np.random.default_rng(0).integers(1, 4, (4, len(source))).astype(np.uint8)
    return Correspondences(source, target, *labels), np.vstack((T[:3], [0, 0, 0, 1]))


def dense_graph(graph):
    """Return which pairs are consistent, and their weights, as (N, N) matrices."""
    n = len(graph.start) - 1
    consistent, weights = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        row = slice(graph.start[i], graph.start[i + 1])
        assert len(np.unique(graph.index[row])) == row.stop - row.start
        consistent[i, graph.index[row]] = 1
        weights[i, graph.index[row]] = graph.weight[row]
    return consistent, weights


def assert_graph_and_rows(matches, config, printed_cutoff=None):
    """Assert that graph, eigenvector and rows l of M* equal the dense ones.

    With `printed_cutoff` the dense weights end there and not where the graph's do.
    """
    graph = consistency_graph(matches, config)
    gaps = dense.pair_gaps(matches.source, matches.target)
    consistent, weights = dense.geometric_consistency(
        gaps, config.sigma_d, printed_cutoff or config.weight_cutoff)
    found, found_weights = dense_graph(graph)
    # a pair within rounding of the threshold may fall on either side
    edge = np.abs(gaps - config.sigma_d) < 1e-9
    assert np.array_equal(found[~edge], consistent[~edge])
    np.testing.assert_allclose(found_weights, weights * found, atol=1e-6)
    np.testing.assert_allclose(leading_eigenvector(graph),
                               dense.leading_eigenvector(consistent * weights), atol=1e-5)

    groups = group(matches, graph, config)
    filtered = filter_groups(matches, graph, groups, len(matches), config.semantics)
    tight = dense.semantic_consistency(matches.source_labels, matches.target_labels)
    loose = dense.semantic_consistency(matches.source_regional, matches.target_regional)
    for key, kept, scores in zip(groups.keys, filtered.kept, filtered.scores, strict=True):
        members = np.argsort(np.linalg.norm(matches.source - matches.source[key], axis=1),
                             kind='stable')[:config.group_size]
        expected = dense.group_matrix(members, consistent, weights, tight, loose)
        row = np.zeros(len(matches))
        row[members] = expected[list(members).index(key)]
        some = kept >= 0
        np.testing.assert_allclose(scores[some], row[kept[some]], rtol=1e-5, atol=1e-5)
        assert set(kept[some]) == set(np.flatnonzero(row))
        assert (np.diff(scores) <= 0).all()


def test_agreement_of_labels_by_hand():
    """What has no label agrees with every class, in point labels and in regional ones."""
    here, there = np.array([0, 0, 13, 13, 13], np.uint8), np.array([0, 13, 0, 13, 15], np.uint8)
    points, same = np.zeros((5, 3)), np.full(5, 13, np.uint8)
    for labels, column in (((here, there, same, same), 0), ((same, same, here, there), 1)):
        agree = label_agreement(Correspondences(points, points, *labels), 'loose')
        assert agree[column].tolist() == [True, True, True, True, False]
        assert agree[1 - column].all()


@pytest.mark.parametrize('cutoff', CUTOFFS)
@pytest.mark.parametrize(('n', 'share', 'seed'), [(40, 0.5, 0), (301, 0.1, 1), (500, 0.9, 2)])
def test_random_matches_equal_the_dense_reference(n, share, seed, cutoff):
    """Graph, weights, eigenvector and rows of M* are those of the equations."""
    matches, _ = random_matches(n, share, seed)
    assert_graph_and_rows(matches, SgorConfig(
        groups=10, group_size=30, group_keep=8, sigma_d=0.5, weight_cutoff=cutoff))


@pytest.mark.parametrize('n', [63, 64, 65, 128, 200])
def test_rows_of_whole_and_broken_words(n):
    """The bits of a row are kept in words of 64."""
    matches, _ = random_matches(n, 0.5, n)
    assert_graph_and_rows(matches, SgorConfig(groups=10, group_size=30, sigma_d=2.0))


@pytest.mark.parametrize('cutoff', CUTOFFS)
@pytest.mark.parametrize('groups', [63, 64, 65, 200, 258])
def test_more_keys_than_a_word_has_bits(groups, cutoff):
    """Keys are worked on in blocks of 64, divided where they stand: each has its own row."""
    matches, _ = random_matches(260, 0.3, groups)
    assert_graph_and_rows(matches, SgorConfig(
        groups=groups, group_size=60, sigma_d=1.0, weight_cutoff=cutoff))


def test_threads_change_nothing():
    """The same sums in the same order, however many threads take the pieces."""
    matches, _ = random_matches(3000, 0.05, 8)
    for config in (SgorConfig(), PAPER):
        one, two = (register_correspondences(matches.source, matches.target,
                                             config=config.replace(threads=threads))
                    for threads in (1, 2))
        assert np.array_equal(one.solution.hypotheses, two.solution.hypotheses)
        assert np.array_equal(one.T_target_source, two.T_target_source)


@pytest.mark.parametrize('name', ['000', '010', '020'])
def test_real_matches_equal_the_dense_reference(data_folder, name):
    """On real FPFH matches, thinned so that the dense matrices fit, as the equations are printed.

    W_m has no end there; what the paper preset leaves out of it is lost in 1e-5.
    """
    matches, _ = real_matches(data_folder, name)
    rows = np.arange(0, len(matches), 5)
    thinned = Correspondences(*(getattr(matches, f)[rows] for f in (
        'source', 'target', 'source_labels', 'target_labels', 'source_regional',
        'target_regional')))
    assert_graph_and_rows(thinned, PAPER.replace(groups=10, group_size=50, key_spacing=0.0),
                          printed_cutoff=np.inf)


@pytest.mark.parametrize('keep', [3, 12])
def test_the_best_are_kept(keep):
    """Eq. 13: of all that are consistent with the key, those with the highest scores, in order."""
    matches, _ = random_matches(400, 0.3, 7)
    config = SgorConfig(groups=20, group_size=200)
    graph = consistency_graph(matches, config)
    groups = group(matches, graph, config)
    everything = filter_groups(matches, graph, groups, len(matches), 'none')
    best = filter_groups(matches, graph, groups, keep, 'none')
    assert np.array_equal(best.scores, everything.scores[:, :keep])
    distinct = np.diff(everything.scores[:, :keep + 1]).all(axis=1)    # ties may swap
    assert distinct.any()
    assert np.array_equal(best.kept[distinct], everything.kept[distinct, :keep])


@pytest.mark.parametrize('name', ['000', '010', '020'])
def test_solver_equals_the_dense_solver(data_folder, name):
    """Matches in, transformation out: the paper preset and the equations agree to 1e-5."""
    matches, _ = real_matches(data_folder, name)
    config = PAPER.replace(groups=30, group_size=200, key_spacing=0.0)
    rows = np.arange(0, len(matches), 3)
    source, target = matches.source[rows], matches.target[rows]
    result = register_correspondences(source, target, config=config)
    expected = dense.solve(source, target, config.sigma_d, np.inf, config.groups,
                           config.group_size, config.group_keep, config.tau_1)
    np.testing.assert_allclose(result.T_target_source, expected, atol=1e-5)


def test_semantics_settings():
    """None keeps all; hard drops what disagrees in points; loose takes either."""
    matches, _ = random_matches(60, 1.0, 3)
    tight = matches.source_labels == matches.target_labels
    regional = matches.source_regional == matches.target_regional
    assert all(a.all() for a in label_agreement(matches, 'none'))
    assert np.array_equal(label_agreement(matches, 'hard')[0], tight)
    assert not label_agreement(matches, 'hard')[1].any()
    assert np.array_equal(label_agreement(matches, 'loose')[1], regional)


def test_rigid_motion_changes_nothing():
    """Moving the target moves the answer and nothing else."""
    matches, T = random_matches(800, 0.15, 4)
    move = np.eye(4)
    move[:3, :3] = Rotation.from_euler('zyx', [2.0, 0.4, -0.7]).as_matrix()
    move[:3, 3] = 5.0, -60.0, 2.0
    plain = register_correspondences(matches.source, matches.target)
    moved = register_correspondences(
        matches.source, matches.target @ move[:3, :3].T + move[:3, 3])
    np.testing.assert_allclose(moved.T_target_source, move @ plain.T_target_source, atol=1e-6)
    np.testing.assert_allclose(plain.T_target_source, T, atol=0.05)


def test_order_of_matches_changes_nothing():
    """A permutation of the rows gives the same transformation."""
    matches, _ = random_matches(800, 0.15, 5)
    order = np.random.default_rng(0).permutation(len(matches))
    plain = register_correspondences(matches.source, matches.target)
    mixed = register_correspondences(matches.source[order], matches.target[order])
    np.testing.assert_allclose(mixed.T_target_source, plain.T_target_source, atol=1e-6)
    assert np.array_equal(mixed.inliers, plain.inliers[order])


def test_memory_of_8000_matches(data_folder):
    """The graph takes memory for consistent pairs alone, however far W_m reaches."""
    matches, _ = random_matches(8000, 0.02, 6)
    for config in (SgorConfig(), PAPER):
        tracemalloc.start()
        graph = consistency_graph(matches, config)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        pairs = len(graph.index)
        assert pairs < 0.02 * 8000**2
        assert graph.index.nbytes + graph.weight.nbytes == 6 * pairs
        # the upper half of the pairs beside all, and one band of bits for each core
        assert peak < 12 * pairs + 5e6


def test_many_matches_are_counted_in_more_bits():
    """Beyond 65,536 matches an index takes 32 bits; the far ones have edges like the others."""
    matches, _ = random_matches(66000, 1.0, 9)
    wrong = np.random.default_rng(0).permutation(66000)[:64000]
    matches.target[wrong] += np.arange(64000)[:, None] * [3.0, 0, 0]    # each by another length
    graph = consistency_graph(matches, SgorConfig(sigma_d=0.01))
    assert graph.index.dtype == np.uint32
    for i in (0, 65535, 65536, 65999):
        row = graph.index[graph.start[i]:graph.start[i + 1]]
        gaps = np.abs(np.linalg.norm(matches.source - matches.source[i], axis=1)
                      - np.linalg.norm(matches.target - matches.target[i], axis=1))
        assert set(row) == set(np.flatnonzero(gaps <= 0.01))
