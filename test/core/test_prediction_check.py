"""Transformations that somebody expects: confirmed where the clouds bear them out, else not."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import InputError
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import Status
from sgor_ros.commands.scene_pairs import scene_drive
from sgor_ros.core.common import se3
from sgor_ros.core.prediction_check import check_prediction

CONFIG = SgorConfig()


@pytest.fixture(scope='module')
def pair(street):
    """Return two street scans 1.5 m apart and T_target_source."""
    target, source = (preprocess(SemanticScan(*scan[:2]), CONFIG) for scan in street[:2])
    return source, target, relative(street[0][2], street[1][2])


def moved(x=0.0, y=0.0, z=0.0, yaw_deg=0.0):
    return se3.compose(Rotation.from_euler('z', yaw_deg, degrees=True).as_matrix(),
                       np.array([x, y, z]))


@pytest.mark.parametrize('offset', [
    moved(), moved(0.5), moved(-0.3, 0.3, 0.1, 2.0), moved(yaw_deg=-3.0)])
def test_what_is_nearly_right_is_confirmed_and_made_right(pair, offset):
    """To the answer of `register`, with its covariance; the correspondences are real."""
    source, target, truth = pair
    found = check_prediction(source, target, truth @ offset, CONFIG)
    known = register(source, target)
    assert found.success, found.reason
    metres, degrees = errors(found.T_target_source, known.T_target_source)
    assert metres < 0.005
    assert degrees < 0.02
    np.testing.assert_allclose(np.diag(found.covariance), np.diag(known.covariance), rtol=0.2)
    assert found.confidence == pytest.approx(known.confidence, abs=0.01)
    assert found.solution is None    # nothing was matched
    gaps = np.linalg.norm(se3.transform(truth, found.source_points) - found.target_points, axis=1)
    assert len(gaps) > 500
    assert np.median(gaps) < 0.4


@pytest.mark.parametrize('offset', [
    moved(8.0), moved(0.0, -6.0), moved(yaw_deg=180.0), moved(25.0, 0.0, 0.0, 90.0)])
def test_what_is_wrong_is_not_confirmed(pair, offset):
    source, target, truth = pair
    for config in (CONFIG, CONFIG.replace(min_confidence=0.0)):
        found = check_prediction(source, target, truth @ offset, config)
        assert found.status is Status.REFUSED
        assert found.reason == 'keypoints and surfaces disagree'


def test_a_scan_of_another_place_is_not_confirmed(pair, elsewhere):
    """Even where any confidence is accepted."""
    _, target, truth = pair
    other = preprocess(SemanticScan(*elsewhere[0][:2]), CONFIG)
    found = check_prediction(other, target, truth, CONFIG.replace(min_confidence=0.0))
    assert found.status is Status.AMBIGUOUS
    assert found.reason.startswith('ambiguous: ')
    refused = check_prediction(other, target, truth, CONFIG)
    assert refused.status is Status.REFUSED
    assert 'min_confidence 0.85' in refused.reason


@pytest.mark.parametrize('kind', ['tunnel', 'tunnel_lamps_12', 'corridor', 'facade'])
def test_where_scans_slide_or_repeat_nothing_is_confirmed(kind):
    """An expectation there would confirm itself, the true one too."""
    drive = scene_drive(kind, 2, seed=3)
    target, source = (preprocess(frame.read(), CONFIG) for frame in drive.scans)
    truth = relative(*drive.T_world_sensor)
    for along in (0.0, 0.8, -2.0):
        found = check_prediction(source, target, truth @ moved(along), CONFIG)
        assert found.status is Status.REFUSED
        assert found.reason == 'a direction is held weakly'


def test_without_rivals_nothing_is_confirmed(pair):
    source, target, truth = pair
    with pytest.raises(InputError, match='hypothesis_radius = 0'):
        check_prediction(source, target, truth, CONFIG.replace(hypothesis_radius=0.0))


def test_scans_of_different_scales_are_not_compared(pair):
    _, target, truth = pair
    finer = preprocess(target.scan, CONFIG.replace(scale=0.5))
    with pytest.raises(InputError, match=r'prepared at scale 0\.5, target at 1'):
        check_prediction(finer, target, truth, CONFIG)
