"""Any space with the same settings: lengths follow from how large the scans are."""
from pathlib import Path

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.preprocessing import at_scale
from sgor_ros.core.scan.scale import scale_of
from sgor_ros.core.scan.scale import SMALLEST
from sgor_ros.io.datasets import open_drives
from sgor_ros.io.scans import read_scan
from sgor_ros.io.trajectories import read_kitti


def plate(x, y, n=5000, seed=0):
    """Return points in a box of standard deviations x and y, and little height, metres."""
    return np.random.default_rng(seed).normal(size=(n, 3)) * [x, y, 0.3]


def test_lengths_are_multiplied_and_nothing_else():
    street, yard = SgorConfig(), SgorConfig().scaled(0.5)
    for item in SgorConfig.settings():
        before, after = getattr(street, item.name), getattr(yard, item.name)
        if item.name == 'scale':
            assert after == 1.0
        elif item.unit == 'm' and item.name != 'max_range':
            assert after == before / 2
        else:
            assert after == before


@pytest.mark.parametrize('scale', [SMALLEST, 0.01, 1.0, 10.0])
def test_scaled_settings_are_within_their_bounds(scale):
    """The smallest that follows from a scan reaches one bound only, and what is off stays off."""
    scaled = SgorConfig(height_gate=0.0).scaled(scale)
    assert scaled.height_gate == 0.0
    assert scaled.voxel_size == pytest.approx(max(0.5 * scale, 0.01))
    assert SgorConfig().scaled(1.0) == SgorConfig(scale=1.0)


@pytest.mark.parametrize(('x', 'y', 'scale'), [
    (20, 20, 1), (60, 60, 1), (40, 5, 1), (7, 7, 1), (20, 0.8, 0.5), (3.5, 3.5, 0.5),
    (0.9, 0.7, 0.125), (0.1, 0.1, SMALLEST)])
def test_the_scale_is_that_of_the_area(x, y, scale):
    """A long street is one, a corridor is small; however it is turned and wherever its origin."""
    points = plate(x, y)
    assert scale_of(points) == scale
    assert scale_of(points @ Rotation.random(random_state=0).as_matrix().T + [30, -20, 5]) == scale


def test_a_scale_is_kept_where_it_fits_nearly_as_well():
    """From 5 m on a space is a street; a drive that knows better keeps what it has for a while."""
    yard, street = plate(4.5, 4.5), plate(5.5, 5.5)
    assert (scale_of(yard), scale_of(street)) == (0.5, 1.0)
    assert (scale_of(yard, 1.0), scale_of(street, 0.5)) == (1.0, 0.5)
    assert (scale_of(plate(3.0, 3.0), 1.0), scale_of(plate(10.0, 10.0), 0.5)) == (0.5, 1.0)


def test_too_few_points_are_no_reason_to_change_anything():
    assert scale_of(np.zeros((0, 3))) == scale_of(np.ones((2, 3))) == 1.0


def test_streets_are_of_scale_one_whatever_the_sensor(street, data_folder):
    """All beams, every fourth column, KITTI, every fourth point of it, and nuScenes."""
    scans = [SemanticScan(points[::step], labels[::step]) for points, labels, _ in street
             for step in (1, 4)]
    for drive in open_drives(data_folder):
        scans += [frame.read() for frame in drive.scans[::5]]
    scans += [SemanticScan(scan.points[::4]) for scan in scans[-5:]]
    assert {preprocess(scan).scale for scan in scans} == {1.0}
    fixed = preprocess(scans[0], SgorConfig(scale=1.0))
    np.testing.assert_array_equal(preprocess(scans[0]).features.descriptors,
                                  fixed.features.descriptors)


@pytest.mark.parametrize('labels', [True, False])
@pytest.mark.parametrize('shrink', [0.5, 0.25, 0.125])
def test_a_model_of_the_street_registers_as_the_street_does(street, shrink, labels):
    """The same scans a half to an eighth as large, at settings for up to four times that.

    The median of nine: each is moved a little, so that it has a grid of the refinement of its own.
    """
    T = relative(street[0][2], street[3][2])
    T[:3, 3] *= shrink
    found = []
    for moved in np.float32(1e-5) * np.arange(9, dtype=np.float32):
        source, target = (preprocess(SemanticScan(points * np.float32(shrink) + moved,
                                                  ids if labels else None))
                          for points, ids, _ in (street[3], street[0]))
        assert {source.scale, target.scale} <= {shrink, 2 * shrink, 4 * shrink}
        result = register(source, target)
        assert result.success, result.reason
        found.append(errors(result.T_target_source, T))
    metres, degrees = np.median(found, axis=0)
    assert metres < 0.1 * shrink
    assert degrees < 0.2


def test_two_scans_of_different_scales_meet_at_the_larger(street):
    """Both ways, and the results are of one configuration."""
    scans = [SemanticScan(points, labels) for points, labels, _ in street]
    fine = preprocess(scans[1], SgorConfig(scale=0.5))
    coarse = preprocess(scans[0])
    assert (fine.scale, coarse.scale) == (0.5, 1.0)
    assert len(fine.features.points) > 1.5 * len(at_scale(fine, 1.0).features.points)
    for pair, T in (((fine, coarse), relative(street[0][2], street[1][2])),
                    ((coarse, fine), relative(street[1][2], street[0][2]))):
        result = register(*pair)
        assert result.success, result.reason
        assert errors(result.T_target_source, T)[0] < 0.05
    same = at_scale(coarse, 1.0)
    assert same is coarse


def test_given_descriptors_are_kept_at_another_scale(street):
    points, labels, _ = street[0]
    keypoints = preprocess(SemanticScan(points, labels)).features.points
    given = np.random.default_rng(0).random((len(keypoints), 8))
    prepared = preprocess(SemanticScan(points, labels), keypoints=keypoints, descriptors=given)
    again = at_scale(prepared, 0.5)
    assert again.scale == 0.5
    assert again.features.descriptors.shape[1] == 8
    assert len(again.features.points) > 0


def truth_of_fragments(folder):
    rows = (folder / 'indoor/7-scenes-redkitchen_gt.log').read_text().split('\n')
    at = next(i for i, row in enumerate(rows) if row.split()[:2] == ['0', '4'])
    return np.array([row.split() for row in rows[at + 1:at + 5]], float)


@pytest.mark.parametrize('turn', [None, 1, 2])
def test_fragments_of_a_room_in_any_orientation(data_folder, turn):
    """No sensor in the middle, no upright, and the largest plane is no floor."""
    source, target = (read_scan(data_folder / f'indoor/cloud_bin_{i}.ply') for i in (4, 0))
    M = np.eye(4)
    if turn is not None:
        M[:3, :3] = Rotation.random(random_state=turn).as_matrix()
    result = register(SemanticScan(source.points @ M[:3, :3].T), target)
    assert result.success, result.reason
    metres, degrees = errors(result.T_target_source @ M, truth_of_fragments(data_folder))
    assert metres < 0.06
    assert degrees < 2.0


def test_a_narrow_view(data_folder):
    """The Livox pair, 29 m apart and with a third in common."""
    truth = np.loadtxt(data_folder / 'livox/T_target_source.txt').reshape(4, 4)
    result = register(*(read_scan(data_folder / f'livox/{name}.pcd')
                        for name in ('source', 'target')))
    assert result.success, result.reason
    metres, degrees = errors(result.T_target_source, truth)
    assert metres < 0.1
    assert degrees < 0.2


@pytest.mark.parametrize(('source', 'target'), [(19, 14), (12, 7), (11, 5), (14, 9), (8, 0)])
def test_a_courtyard(data_folder, source, target):
    """Without labels, 3 to 9 m apart, turned by any yaw."""
    drive = Path(data_folder).parent / 'drives/courtyard'
    if not drive.is_dir():
        pytest.skip(f'no {drive}')
    files = sorted((drive / 'velodyne').glob('*.bin'))
    poses = read_kitti(drive / 'poses.txt')
    M = np.eye(4)
    M[:3, :3] = Rotation.from_euler('zy', [10.0 * source, 2.0], degrees=True).as_matrix()
    result = register(SemanticScan(read_scan(files[source]).points @ M[:3, :3].T),
                      read_scan(files[target]))
    assert result.success, result.reason
    metres, degrees = errors(result.T_target_source @ M, relative(poses[target], poses[source]))
    assert metres < 0.1
    assert degrees < 0.5
