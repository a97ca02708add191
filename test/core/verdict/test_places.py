"""The verdict on places of all kinds, exactly: its status, and where the other poses lie.

What a place repeats at and along which axis, x, is known from how it is built (`Place.repeats`).
"""
from itertools import pairwise

from conftest import errors
from conftest import relative
import numpy as np
import pytest

from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros.core.common import se3
from sgor_ros.core.verdict.result import Status
from sgor_ros.world import Lidar
from sgor_ros.world import scenes

STATUS = {'R': Status.REGISTERED, 'A': Status.AMBIGUOUS, 'D': Status.DEGENERATE,
          'F': Status.REFUSED, 'N': Status.NO_SOLUTION}
VERDICTS = {
    # of three pairs: with labels, without
    ('tunnel', 50): ('AAA', 'AAA'),
    ('tunnel_lamps_12', 50): ('AAA', 'AAA'),
    ('tunnel_lamps_25', 50): ('AAA', 'AAA'),
    ('road_tunnel', 50): ('RRR', 'RRR'),
    ('corridor', 50): ('AAA', 'AAA'),
    ('facade', 50): ('DDD', 'DDD'),     # hardly any relief: 10 m further on is as good as 11 m
    ('facade', 51): ('AAA', 'AAA'),
    ('facade_cars_regular', 51): ('AAA', 'AAA'),
    ('facade_cars_random', 51): ('RRR', 'RRR'),
    ('garage_empty', 50): ('AAA', 'AAA'),
    ('garage_half_full', 50): ('RRR', 'RRR'),
    ('orchard_regular', 50): ('AAA', 'AAA'),
    ('orchard_jittered', 50): ('FRR', 'FRR'),
    ('highway', 50): ('RRR', 'DDD'),    # rails, and a post each 50 m
    ('field', 50): ('RRN', 'RRR'),
    ('parking_regular', 50): ('AAA', 'AAA'),
    ('parking_jittered', 51): ('RRR', 'FRR'),
    ('courtyard', 50): ('RRR', 'RRR'),
}
FREE = {'tunnel', 'tunnel_lamps_12', 'tunnel_lamps_25'}
"""Where the poses that compete slide, too."""
MIRRORED = {*FREE, 'corridor'}
"""Alike under half a turn about the middle, y = 0."""
SPACING = 0.3    # metres
ANGLE = np.radians(3.0)
BOUND = 20.06    # of chi2 with 6 degrees of freedom at 99.73 %


QUICK = {'tunnel', 'facade', 'garage_empty', 'highway', 'courtyard'}
"""One or two of each verdict, for `make test-fast`."""


@pytest.fixture(scope='module', params=[
    pytest.param(case, marks=() if case[0] in QUICK else pytest.mark.slow, id='-'.join(
        map(str, case))) for case in VERDICTS])
def views(request):
    """Return kind, seed, place, and of three pairs the scans and poses: source, then target."""
    kind, seed = request.param
    place = scenes.make(kind, seed)
    lidar, rng = Lidar(beams=64, columns=900), np.random.default_rng(seed)
    pairs = []
    for _ in range(3):
        poses = scenes.random_pair(place, rng, *scenes.KINDS[kind].distances)
        pairs.append(([lidar.scan(place, pose, rng) for pose in poses], poses))
    return kind, seed, place, pairs


def off_grid(shift, repeats):
    """Return how far a shift in the world is from whole periods along x and y, and its z, m."""
    return np.array([0.0 if period == 0 else abs(way) if period == np.inf
                     else abs(way - period * round(way / period))
                     for way, period in zip(shift, (*repeats, np.inf), strict=True)])


def shift_between(T_world_target, T, other):
    """Return by how much two poses of the source differ, in the axes of the world, metres."""
    return T_world_target[:3, :3] @ (other[:3, 3] - T[:3, 3])


def angle_between(T, other):
    return np.degrees(se3.angle(other[:3, :3] @ T[:3, :3].T))


def assert_along_the_axis(directions, T_world_target):
    """One direction, within three degrees of the axis of the place, that turns nothing."""
    assert len(directions) == 1
    shift = T_world_target[:3, :3] @ directions[0, :3]
    assert np.linalg.norm(shift) == pytest.approx(1.0, abs=1e-3)
    assert np.arccos(min(abs(shift[0]), 1.0)) < ANGLE


def assert_registered(result, truth):
    assert result.success
    assert result.reason == ''
    assert result.confidence == result.score.confidence >= 0.85
    metres, degrees = errors(result.T_target_source, truth)
    assert metres < 0.1
    assert degrees < 0.5
    assert result.alternatives == ()
    assert len(result.degenerate) == 0


def assert_refused(result):
    assert 'is below min_confidence 0.85' in result.reason
    assert result.confidence < 0.85
    assert result.alternatives == ()
    assert len(result.degenerate) == 0


def assert_degenerate(result, truth, T_world_target):
    """Right but for the axis, and the truth within the covariance."""
    assert_along_the_axis(result.degenerate, T_world_target)
    assert result.alternatives == ()
    assert result.reason.startswith('degenerate: the clouds slide along')
    assert result.confidence < 0.3
    shift = shift_between(T_world_target, truth, result.T_target_source)
    assert np.abs(shift[1:]).max() < 0.1
    assert angle_between(truth, result.T_target_source) < 0.5
    error = se3.perturbation(result.T_target_source, truth)
    assert error @ np.linalg.solve(result.covariance, error) < BOUND


def assert_ambiguous(result, truth, poses, place, kind):
    """A pose that the place repeats at, and others at its periods from it."""
    T, T_world_target = result.T_target_source, poses[1]
    count = len(result.alternatives)
    assert count >= 1
    assert len(result.degenerate) == 0
    assert result.reason.startswith(f'ambiguous: {1 + count} placements explain')
    assert result.confidence == pytest.approx(result.score.confidence / (1 + count))
    assert result.score.confidence >= 0.85
    if angle_between(truth, T) < 5:
        shift = shift_between(T_world_target, truth, T)
        assert off_grid(shift, place.repeats).max() < SPACING
    if kind in MIRRORED:
        y = poses[0][1, 3]
        for other in (T, result.alternatives[0].T_target_source):
            same = angle_between(truth, other) < 90
            assert (T_world_target @ other)[1, 3] == pytest.approx(y if same else -y, abs=0.1)
    straight = [other.T_target_source for other in result.alternatives
                if angle_between(T, other.T_target_source) < 3]
    for other in result.alternatives:
        if kind in FREE:
            assert_along_the_axis(other.degenerate, T_world_target)
        turned = angle_between(T, other.T_target_source)
        assert turned < 3 or turned > 85, 'quarter turns'
    if straight and kind not in FREE:
        off = [off_grid(shift_between(T_world_target, T, other), place.repeats).max()
               for other in straight]
        assert off[0] < SPACING, 'the best of them a whole number of periods away'
        assert np.mean(np.array(off) < SPACING) >= 0.5
        assert np.linalg.norm(straight[0][:3, 3] - T[:3, 3]) > min(place.repeats) - SPACING
    return len(straight)


@pytest.mark.parametrize('labels', [True, False])
def test_the_verdict_on_a_place_of_each_kind(views, labels):
    kind, seed, place, pairs = views
    found = []
    in_line = 0
    for scans, poses in pairs:
        source, target = (SemanticScan(points, ids if labels else None) for points, ids in scans)
        result = register(source, target)
        truth = relative(poses[1], poses[0])
        found.append(result.status)
        if result.status is Status.REGISTERED:
            assert_registered(result, truth)
        elif result.status is Status.AMBIGUOUS:
            in_line += assert_ambiguous(result, truth, poses, place, kind)
        elif result.status is Status.DEGENERATE:
            assert_degenerate(result, truth, poses[1])
        elif result.status is Status.REFUSED:
            assert_refused(result)
        else:
            assert result.T_target_source is None
            assert 'inliers, min_inliers is 5' in result.reason
    assert found == [STATUS[letter] for letter in VERDICTS[kind, seed][not labels]]
    if 0 < place.repeats[0] < np.inf and kind not in FREE and 'D' not in VERDICTS[kind, seed][0]:
        assert in_line >= 3, 'a pair of them each, one period apart'


@pytest.mark.parametrize(('kind', 'verdicts'), [
    ('tunnel', 'AA'), ('facade', 'AF'), ('highway', 'FA')])
def test_different_places_of_one_kind_are_told_apart(kind, verdicts):
    """But for tunnels of one section and facades of one design: those are alike, and repeat."""
    lidar, rng = Lidar(beams=64, columns=900), np.random.default_rng(7)
    views = []
    for seed in (70, 71, 72):
        place = scenes.make(kind, seed)
        views.append(SemanticScan(*lidar.scan(place, scenes.random_pose(place, rng), rng)))
    results = [register(source, target) for source, target in pairwise(views)]
    assert [result.status for result in results] == [STATUS[letter] for letter in verdicts]


def noise(seed, count, size=40.0):
    return np.random.default_rng(seed).uniform(-size / 2, size / 2, (count, 3))


@pytest.mark.parametrize(('source', 'target', 'reason'), [
    (noise(0, 30000, 60.0), noise(1, 30000, 60.0), 'only 0 inliers, min_inliers is 5'),
    (noise(0, 50), noise(0, 50), 'no group of correspondences is consistent'),
    (noise(0, 2), noise(0, 2), 'only 2 correspondences'),
    (noise(0, 20000) * [1, 1, 0] - [0, 0, 1.7], noise(1, 20000) * [1, 1, 0] - [0, 0, 1.7],
     'only 0 correspondences')],
    ids=['noise', 'few points', 'two points', 'a floor'])
def test_where_nothing_matches_there_is_no_solution(source, target, reason):
    result = register(source, target)
    assert result.status is Status.NO_SOLUTION
    assert result.reason == reason
    assert result.T_target_source is result.score is result.covariance is None
    assert result.confidence == 0.0
    assert result.alternatives == ()
    assert result.degenerate.shape == (0, 6)


@pytest.mark.parametrize('labels', [True, False])
def test_another_street_is_refused(street, elsewhere, labels):
    """There is a candidate, and the clouds do not bear it out."""
    source, target = (SemanticScan(points, ids if labels else None)
                      for points, ids, _ in (elsewhere[0], street[0]))
    result = register(source, target)
    assert result.status is Status.REFUSED
    assert_refused(result)
    assert result.T_target_source.shape == (4, 4)
    assert result.covariance is None
