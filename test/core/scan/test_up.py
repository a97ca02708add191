"""Which way is up, and where the sensor is: mounts of any kind, clouds in other frames."""
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

MOUNTS = {'upright': (0, 0, 0), 'upside down': (180, 0, 0), 'pitched by 30': (0, 30, 0),
          'pitched by 90': (0, 90, 0), 'rolled by 90': (90, 0, 0)}


def turned(name):
    return Rotation.from_euler('xyz', MOUNTS[name], degrees=True).as_matrix()


def angle_deg(a, b):
    return np.degrees(np.arccos(np.clip(a @ b, -1, 1)))


@pytest.mark.parametrize('height', [-3.0, 0.0, 1.6, 1.73, 2.2, 15.0])
def test_up_is_where_things_stand_wherever_the_origin_is(street, height):
    """Origin so far over that of the sensor or below it, on the road and under it, no labels."""
    points = street[0][0] + np.float32([0, 0, height])
    ground = preprocess(SemanticScan(points, origin=[0, 0, height])).ground
    assert ground.source == 'geometry'
    assert ground.certain
    assert angle_deg(ground.normal, np.array([0, 0, 1.0])) < 1.0
    assert ground.offset == pytest.approx(1.73 - height, abs=0.1)


@pytest.mark.parametrize('mount', MOUNTS)
def test_up_that_is_told(street, mount):
    """To within 20 degrees: the ground is that of the upright sensor."""
    R = turned(mount)
    told = R @ Rotation.from_euler('x', 20, degrees=True).as_matrix() @ [0, 0, 1.0]
    ground = preprocess(SemanticScan(street[0][0] @ R.T.astype(np.float32), up=told)).ground
    assert ground.certain
    assert angle_deg(ground.normal, R @ [0, 0, 1.0]) < 1.0
    assert ground.offset == pytest.approx(1.73, abs=0.1)


@pytest.mark.parametrize('mount', ['upside down', 'pitched by 30'])
def test_up_that_nobody_tells(street, mount):
    R = turned(mount)
    ground = preprocess(SemanticScan(street[0][0] @ R.T.astype(np.float32))).ground
    assert angle_deg(ground.normal, R @ [0, 0, 1.0]) < 1.0


def test_up_of_the_scan_before_is_kept_while_a_plane_agrees(street):
    """Pitched by 90 it is the road; where the scan before was wrong it is looked for anew."""
    R = turned('pitched by 90')
    pitched = SemanticScan(street[0][0] @ R.T.astype(np.float32))
    ground = preprocess(pitched, up_before=R @ [0, 0, 1.0]).ground
    assert angle_deg(ground.normal, R @ [0, 0, 1.0]) < 1.0
    slanted = np.array([1.0, 1.0, 1.0]) / np.sqrt(3)
    ground = preprocess(SemanticScan(street[0][0]), up_before=slanted).ground
    assert angle_deg(ground.normal, np.array([0, 0, 1.0])) < 1.0


def test_range_limits_and_free_space_follow_the_origin(street):
    """A scan shifted with its origin is the same scan, but for where it lies."""
    at = np.array([30.0, -20.0, 5.0])
    config = SgorConfig(min_range=6.0, max_range=40.0)
    plain, shifted = (preprocess(SemanticScan(street[0][0] + np.float32(shift), street[0][1],
                                              origin=shift), config)
                      for shift in (np.zeros(3), at))
    distance = np.linalg.norm(shifted.features.points - at, axis=1)
    assert distance.min() > 5.5
    assert distance.max() < 40.5
    np.testing.assert_array_equal(shifted.index.origin, at)
    both = np.isfinite(plain.index.ranges) & np.isfinite(shifted.index.ranges)
    assert both.sum() > 0.99 * np.isfinite(plain.index.ranges).sum()
    assert np.median(np.abs(plain.index.ranges - shifted.index.ranges)[both]) < 1e-4
    assert shifted.ground.offset == pytest.approx(
        plain.ground.offset - at @ plain.ground.normal, abs=0.02)


def test_a_pair_shifted_with_its_origins_registers_as_it_was(street):
    """To a centimetre where the grid lies the same, with the score of before."""
    truth = relative(street[0][2], street[2][2])
    at = np.array([64.0, -32.0, 8.0])    # whole voxels, exact in float32
    found = []
    for shift in (np.zeros(3), at):
        target, source = (SemanticScan(street[i][0] + np.float32(shift), origin=shift)
                          for i in (0, 2))
        result = register(source, target)
        assert result.success, result.reason
        back = np.eye(4)
        back[:3, 3] = shift
        T = np.linalg.inv(back) @ result.T_target_source @ back
        assert errors(T, truth)[0] < 0.05
        assert errors(T, truth)[1] < 0.1
        found.append(result.score)
    assert found[1].overlap == pytest.approx(found[0].overlap, abs=0.02)
    assert found[1].violations == pytest.approx(found[0].violations, abs=0.005)


@pytest.mark.parametrize(('name', 'value', 'message'), [
    ('origin', [0, 0], 'origin: expected 3 finite numbers'),
    ('origin', [0, 0, float('nan')], 'origin: expected 3 finite numbers'),
    ('up', [0, 0, 0], 'up: has no length')])
def test_what_is_no_vector_is_refused(name, value, message):
    with pytest.raises(InputError, match=message):
        SemanticScan(np.ones((2, 3)), **{name: value})


def test_up_is_of_length_one():
    np.testing.assert_array_equal(SemanticScan(np.ones((2, 3)), up=[0, 0, -4]).up, [0, 0, -1])
