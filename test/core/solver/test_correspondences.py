"""Semantic overlap region and matching, against brute force."""
from dataclasses import replace

import numpy as np
import pytest

from sgor_ros import InputError
from sgor_ros import register_correspondences
from sgor_ros import SgorConfig
from sgor_ros.core.features.features import Features
from sgor_ros.core.matching.correspondences import given_correspondences
from sgor_ros.core.matching.correspondences import match
from sgor_ros.core.matching.correspondences import overlap_region
from sgor_ros.core.matching.correspondences import thin

PLAIN = SgorConfig(match_within_labels=False, height_gate=0.0, context_weight=0.0)


def features(n, seed, columns=33):
    """Return n random keypoints of three classes with heights and context."""
    rng = np.random.default_rng(seed)
    descriptors, context = rng.random((n, columns)), rng.random((n, 12))
    context[:, 3] = 0 if seed else 0.7    # of a class that only the first scan has
    for part in (context[:, :3], context[:, 3:]):
        part /= np.linalg.norm(part, axis=1, keepdims=True)
    return Features(
        rng.uniform(-30, 30, (n, 3)), *rng.choice([0, 13, 15, 18], (2, n)).astype(np.uint8),
        *(np.float32(a / np.linalg.norm(a, axis=1, keepdims=True))[:n] for a in (descriptors,)),
        rng.uniform(0, 4, n), np.float32(context))


def brute_force(source, target, config):
    """Return pairs (i, j) of nearest joint descriptors among the candidates allowed."""
    gap = np.linalg.norm(source.descriptors[:, None] - target.descriptors[None], axis=-1)**2
    if config.context_weight > 0:
        # empty in one scan does not count; whatever class it is only without semantics
        columns = slice(3) if config.semantics == 'none' else slice(3, None)
        p, q = source.context[:, columns], target.context[:, columns]
        used = p.any(axis=0) & q.any(axis=0)
        gap += config.context_weight**2 * np.linalg.norm(
            p[:, None, used] - q[None][..., used], axis=-1)**2
    allowed = np.ones(gap.shape, bool)
    if config.match_within_labels and config.semantics != 'none':
        a, b = source.regional[:, None], target.regional[None]
        allowed &= (a == b) | (a == 0) | (b == 0)
    if config.height_gate > 0:
        allowed &= np.abs(source.heights[:, None] - target.heights[None]) <= config.height_gate
    gap[~allowed] = np.inf
    return [(i, gap[i].argmin()) for i in range(len(gap)) if np.isfinite(gap[i]).any()]


@pytest.mark.parametrize('labels', [True, False])
@pytest.mark.parametrize('gate', [0.0, 0.05])
@pytest.mark.parametrize('context', [0.0, 1.5])
@pytest.mark.parametrize('semantics', [SgorConfig().semantics, 'none'])
def test_matches_equal_brute_force(labels, gate, context, semantics):
    """Each restriction alone and all together; points and both labels come along."""
    source, target = features(300, 0), features(400, 1)
    config = SgorConfig(match_within_labels=labels, height_gate=gate, context_weight=context,
                        semantics=semantics)
    found = match(source, target, config)
    pairs = brute_force(source, target, config)
    assert 0 < len(pairs) <= 300
    i, j = np.array(pairs).T
    np.testing.assert_array_equal(found.source, source.points[i])
    np.testing.assert_array_equal(found.target, target.points[j])
    np.testing.assert_array_equal(found.source_labels, source.labels[i])
    np.testing.assert_array_equal(found.target_labels, target.labels[j])
    np.testing.assert_array_equal(found.source_regional, source.regional[i])
    np.testing.assert_array_equal(found.target_regional, target.regional[j])


def test_without_semantics_labels_do_not_count():
    """Neither regional labels nor the columns of classes change a match; the others do."""
    source, target = features(300, 0), features(400, 1)
    config = SgorConfig(semantics='none', match_within_labels=True, height_gate=0.0,
                        context_weight=1.5)
    plain = match(source, target, config).target
    assert len(plain) == 300
    mixed = target.context.copy()
    mixed[:, 3:] = mixed[::-1, 3:]
    other = replace(target, regional=target.regional[::-1].copy(), surrounded=mixed)
    np.testing.assert_array_equal(match(source, other, config).target, plain)
    mixed = target.context.copy()
    mixed[:, :3] = mixed[::-1, :3]
    other = replace(target, surrounded=mixed)
    assert (match(source, other, config).target != plain).any(axis=1).mean() > 0.5


def test_keypoints_without_a_candidate_have_no_match():
    """A label that only the source has; a height that only the source has."""
    source, target = features(20, 0), features(30, 1)
    target = replace(target, regional=np.full(30, 13, np.uint8))
    other = replace(source, regional=np.full(20, 99, np.uint8))
    assert len(match(other, target, SgorConfig(height_gate=0.0))) == 0
    high = replace(source, heights=source.heights + 50)
    assert len(match(high, target, SgorConfig(match_within_labels=False))) == 0
    assert len(match(high, target, PLAIN)) == 20


def test_without_ground_in_one_scan_heights_do_not_count():
    source, target = features(50, 0), features(60, 1)
    config = SgorConfig(match_within_labels=False, context_weight=0.0, height_gate=0.01)
    found = match(replace(source, heights=None), target, config)
    np.testing.assert_array_equal(found.target, match(source, target, PLAIN).target)


def test_nothing_to_match():
    """Empty on either side is an empty set."""
    some, none = features(20, 0), features(20, 1)[np.zeros(20, bool)]
    assert len(match(some, none, SgorConfig())) == 0
    assert len(match(none, some, SgorConfig())) == 0


def test_overlap_region_by_hand():
    """Eq. 4: 13 is in both; 15 and 18 in one only; what has no label stays.

    The two of 18 cannot all be the one without a label; 15 has none to be.
    """
    source, target = features(4, 0), features(3, 1)
    source = replace(source, labels=np.array([13, 15, 0, 13], np.uint8))
    target = replace(target, labels=np.array([18, 13, 18], np.uint8))
    p, q = overlap_region(source, target)
    assert p.labels.tolist() == [13, 0, 13]
    assert q.labels.tolist() == [13]
    for part, whole, rows in ((p, source, [0, 2, 3]), (q, target, [1])):
        np.testing.assert_array_equal(part.points, whole.points[rows])
        np.testing.assert_array_equal(part.descriptors, whole.descriptors[rows])
        np.testing.assert_array_equal(part.heights, whole.heights[rows])
        np.testing.assert_array_equal(part.context, whole.context[rows])


def test_a_class_may_be_hidden_among_the_unlabelled():
    """Both points of 18 may be two of the target's three without a label, all three of 15 not."""
    source, target = features(5, 0), features(4, 1)
    source = replace(source, labels=np.array([18, 15, 15, 18, 15], np.uint8))
    target = replace(target, labels=np.array([0, 0, 13, 13], np.uint8))
    p, q = overlap_region(source, target)
    assert p.labels.tolist() == [18, 18]
    assert q.labels.tolist() == [0, 0]


@pytest.mark.parametrize(('count', 'most'), [(10, 10), (3, 10), (1000, 7), (1001, 1000), (0, 5)])
def test_thinning_is_even(count, most):
    """At most so many, all different, ends included, steps that differ by one at most."""
    rows = thin(count, most)
    assert len(rows) == min(count, most)
    assert len(set(rows)) == len(rows)
    if count:
        assert (rows[0], rows[-1]) == (0, count - 1)
    if count > most:
        steps = np.diff(rows)
        assert steps.max() - steps.min() <= 1


def test_matching_thins_the_source_only():
    source, target = features(300, 0), features(400, 1)
    found = match(source, target, PLAIN.replace(max_correspondences=50))
    np.testing.assert_array_equal(found.source, source.points[thin(300, 50)])
    full = match(source, target, PLAIN)
    np.testing.assert_array_equal(found.target, full.target[thin(300, 50)])


def test_regional_labels_of_given_matches_by_hand():
    """Two near ones outvote the third beside them; one 5 m off keeps its own."""
    source = [[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [5, 0, 0]]
    target = np.array(source) + [100, 0, 0]
    found = given_correspondences(source, target, [50, 50, 70, 80], [70, 70, 70, 50], SgorConfig())
    assert found.source_labels.tolist() == [13, 13, 15, 18]
    assert found.source_regional.tolist() == [13, 13, 13, 18]
    assert found.target_regional.tolist() == [15, 15, 15, 13]


P = np.arange(12.0).reshape(4, 3)
NAN = np.where(np.arange(12).reshape(4, 3) == 7, np.nan, P)


@pytest.mark.parametrize(('arguments', 'words'), [
    ((P, P[:3]), 'target_points: expected one a source point, 4, got 3'),
    ((P[:, :2], P), r'source_points: expected an \(N, 3\) array, got shape \(4, 2\)'),
    ((P, P.ravel()), r'target_points: expected an \(N, 3\) array'),
    ((NAN, P), 'source_points: row 2 is not finite'),
    ((P, NAN), 'target_points: row 2 is not finite'),
    ((P, 'matches'), 'target_points: not an array of numbers'),
    ((P, P, [40] * 4), 'source_labels and target_labels: give both or none'),
    ((P, P, None, [40] * 4), 'source_labels and target_labels: give both or none'),
    ((P, P, [40] * 3, [40] * 4), r'source_labels: expected one a point, \(4,\)'),
    ((P, P, [40] * 4, [40.0] * 4), 'target_labels: expected integers'),
])
def test_what_are_no_matches_is_refused(arguments, words):
    """Which of the four arguments, and what it was."""
    with pytest.raises(InputError, match=words):
        register_correspondences(*arguments)


@pytest.mark.parametrize('count', [0, 1, 2])
def test_too_few_matches_are_a_failure_and_no_error(count):
    result = register_correspondences(P[:count], P[:count])
    assert not result.success
    assert result.reason == f'only {count} correspondences'
    assert result.T_target_source is None
    assert result.inliers.shape == (count,)
