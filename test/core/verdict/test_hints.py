"""Hints: what is wrong with the scans is said, and nothing is said of scans that are right."""
from dataclasses import replace
import re

from conftest import errors
from conftest import relative
import numpy as np
import pytest

from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.verdict.hints import frame_hint
from sgor_ros.core.verdict.hints import scale_hint
from sgor_ros.io.scans import read_scan
from sgor_ros.world import Lidar
from sgor_ros.world import scenes

FRAME = 'in the frame of the sensor'


def scans_of(street, *numbers):
    return [SemanticScan(*street[number][:2]) for number in numbers]


@pytest.mark.parametrize(('change', 'says'), [
    (lambda points: points + [20.0, 0, 0], f'is it {FRAME}'),
    (lambda points: points + [4e5, 5e6, 100], f'beyond max_range .* is it {FRAME}'),
    (lambda points: points * 1000, 'in metres, not in millimetres'),
    (lambda points: points / 1000, 'no point is between .* in metres'),
])
def test_a_refusal_tells_what_is_odd_about_the_points(street, elsewhere, change, says):
    (source,), (target,) = scans_of(street, 0), scans_of(elsewhere, 0)
    spoilt = SemanticScan(change(source.points.astype(float)), source.labels)
    for result, side in ((register(spoilt, target), 'source'),
                         (register(target, spoilt), 'target')):
        assert not result.success
        told = [warning for warning in result.warnings if warning.startswith(side)]
        other = [warning for warning in result.warnings if not warning.startswith(side)]
        assert [warning for warning in told if re.search(says, warning)], told
        assert not [warning for warning in other if FRAME in warning or 'metres' in warning]


@pytest.mark.parametrize('kind', scenes.KINDS)
def test_places_seen_by_a_sensor_give_no_hint(kind):
    rng, place = np.random.default_rng(0), scenes.make(kind, 0)
    for T in scenes.random_pair(place, rng, 2.0, 8.0):
        points, _ = Lidar(beams=32, columns=600).scan(place, T, rng)
        assert frame_hint(points.astype(np.float32), SgorConfig()) == ''


def test_real_scans_give_no_hint(data_folder):
    files = [*data_folder.rglob('velodyne/*.bin'), *data_folder.glob('ouster/*.bin'),
             *data_folder.glob('livox/*.pcd'), *data_folder.glob('unlabelled/*.ply'),
             *data_folder.parent.glob('drives/*/velodyne/*.bin')]
    assert len(files) > 30
    unsaid, asked = [], files[::3]
    for path in asked:
        points = read_scan(path).points
        assert frame_hint(points, SgorConfig()) == '', path
        if FRAME not in frame_hint(points + np.float32([20, 0, 0]), SgorConfig()):
            unsaid.append(path)
    assert len(unsaid) <= 0.02 * len(asked), unsaid


def test_another_size_is_told_and_the_same_is_not(street):
    target, source = scans_of(street, 0, 3)
    truth = relative(street[0][2], street[3][2])
    result = register(source, target)
    assert result.success
    assert not [warning for warning in result.warnings if 'lengths' in warning]
    for factor in (0.98, 1.02):
        result = register(SemanticScan(source.points * np.float32(factor), source.labels), target)
        assert errors(result.T_target_source, truth)[1] < 1
        told, = (warning for warning in result.warnings if 'lengths' in warning)
        assert float(told.split(' times')[0].split()[-1]) == pytest.approx(factor, abs=0.005)


def test_few_matches_say_nothing_of_size(street):
    target, source = scans_of(street, 0, 3)
    result = register(SemanticScan(source.points * np.float32(1.02), source.labels), target)
    rows = np.flatnonzero(result.inliers)[:20]
    few = replace(result, source_points=result.source_points[rows],
                  target_points=result.target_points[rows], inliers=np.ones(20, bool))
    assert scale_hint(result, SgorConfig()) != ''
    assert scale_hint(few, SgorConfig()) == ''
