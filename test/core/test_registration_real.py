"""Registration of real scans and real matches, whose truth is known to some centimetres."""
import json

import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import register_correspondences
from sgor_ros import SgorConfig
from sgor_ros.evaluation.metrics.inliers import inlier_scores
from sgor_ros.evaluation.metrics.pose_error import rotation_error_deg
from sgor_ros.evaluation.metrics.pose_error import translation_error_m
from sgor_ros.io.datasets import open_drives
from sgor_ros.io.scans import read_scan

CONVENTIONS = {'labels': 'semantickitti', 'predicted_labels': 'semantickitti_train'}


def assert_right(result, truth, metres, degrees):
    assert result.success, result.reason
    assert translation_error_m(result.T_target_source, truth) < metres
    assert rotation_error_deg(result.T_target_source, truth) < degrees


@pytest.fixture(scope='module')
def listed(data_folder):
    """Return results of pairs.json with all labels, in both directions: (name, m, T, truth)."""
    prepared = {}

    def prepare(scan, labels):
        if (scan, labels) not in prepared:
            config = SgorConfig(label_convention=CONVENTIONS[labels.split('/')[-2]])
            prepared[scan, labels] = preprocess(
                read_scan(data_folder / scan, data_folder / labels), config)
        return prepared[scan, labels]

    results = []
    for pair in json.loads((data_folder / 'pairs.json').read_text()):
        truth = np.array(pair['T_target_source'])
        for source_labels in pair['source_labels']:
            for target_labels in pair['target_labels']:
                source = prepare(pair['source'], source_labels)
                target = prepare(pair['target'], target_labels)
                name = f'{source_labels} to {target_labels}'
                results += [(name, pair['distance_m'], register(source, target), truth),
                            (f'{name}, back', pair['distance_m'], register(target, source),
                             np.linalg.inv(truth))]
    return results


def test_all_listed_pairs_register(listed):
    """Hand labels and a network's, mixed too, 4 to 25 m apart: none is lost."""
    assert len(listed) == 26
    lost = [name for name, _, result, truth in listed if not result.success
            or translation_error_m(result.T_target_source, truth) > 0.6
            or rotation_error_deg(result.T_target_source, truth) > 5.0]
    assert lost == []


def test_errors_of_the_listed_pairs(listed):
    """Medians within the accuracy of the truth (5 cm, 0.15 deg); far pairs are little worse."""
    def worst_and_median(low, high):
        found = [(translation_error_m(result.T_target_source, truth),
                  rotation_error_deg(result.T_target_source, truth))
                 for _, distance, result, truth in listed if low < distance <= high]
        return np.max(found, axis=0), np.median(found, axis=0)

    for low, high in ((0, 10), (10, 30)):
        (worst_m, worst_deg), (median_m, median_deg) = worst_and_median(low, high)
        assert median_m < 0.05
        assert median_deg < 0.15
        assert worst_m < 0.2
        assert worst_deg < 0.5


def test_covariance_of_the_listed_pairs_is_honest(listed):
    """The errors, truth's own included, are a few standard deviations and not dozens."""
    for name, _, result, truth in listed:
        sigma = np.sqrt(np.diag(result.covariance)[:3])
        error = np.abs(result.T_target_source[:3, 3] - truth[:3, 3])
        assert (error < 4 * sigma + 0.05).all(), name
        assert sigma.max() < 0.3, name


@pytest.mark.parametrize('name', ['000', '010', '020'])
def test_matches_of_kitti(data_folder, name):
    """One to three right matches in a hundred: found, and told from the others."""
    folder = data_folder / 'correspondences'
    source, target = (np.loadtxt(folder / f'kitti_{name}_{side}.txt')
                      for side in ('source', 'target'))
    truth = np.loadtxt(folder / f'kitti_{name}_T_target_source.txt').reshape(-1, 4)
    result = register_correspondences(source, target)
    assert_right(result, truth, 0.6, 5.0)
    scores = inlier_scores(source, target, result.T_target_source, truth, 0.6)
    assert min(scores.precision, scores.recall, scores.f1) > 0.75
    assert result.inliers.sum() > 0.75 * scores.recall * len(source) * 0.008


def test_matches_of_3dmatch(data_folder):
    """A room, by the indoor preset: 15 deg and 0.3 m."""
    matches = np.loadtxt(data_folder / 'correspondences/3dmatch_source_target.txt')
    truth = np.loadtxt(data_folder / 'correspondences/3dmatch_T_target_source.txt').reshape(-1, 4)
    source, target = matches[:, :3], matches[:, 3:]
    result = register_correspondences(source, target, config=SgorConfig.indoor())
    assert_right(result, truth, 0.3, 15.0)
    scores = inlier_scores(source, target, result.T_target_source, truth, 0.1)
    assert min(scores.precision, scores.recall, scores.f1) > 0.7


@pytest.fixture(scope='module')
def nuscenes(data_folder):
    """Return the first five prepared scans of nuScenes, their config and T_world_sensor."""
    drive, = open_drives(data_folder / 'nuscenes')
    config = SgorConfig(label_convention='nuscenes')
    scans = [preprocess(frame.read(), config) for frame in drive.scans[:5]]
    return scans, config, drive.T_world_sensor


@pytest.mark.parametrize('other', [1, 2, 3, 4])
def test_nuscenes(nuscenes, other):
    """32 beams, up to 18 m apart, both directions; the truth is good in x, y and rotation."""
    scans, config, poses = nuscenes
    for source, target in ((other, 0), (0, other)):
        result = register(scans[source], scans[target], config)
        truth = np.linalg.inv(poses[target]) @ poses[source]
        assert result.success, result.reason
        assert np.linalg.norm((result.T_target_source - truth)[:2, 3]) < 0.15
        assert rotation_error_deg(result.T_target_source, truth) < 0.5


def test_a_kitti_scan_is_no_nuscenes_scan(nuscenes, data_folder):
    """Two towns, two sensors: refused with a reason."""
    scans, config, _ = nuscenes
    kitti = preprocess(read_scan(data_folder / 'kitti/08/velodyne/000000.bin',
                                 data_folder / 'kitti/08/labels/000000.label'))
    for source, target in ((kitti, scans[0]), (scans[0], kitti)):
        result = register(source, target, config)
        assert not result.success
        assert result.reason


def test_without_labels(data_folder):
    """A pair of outdoor scans from a sensor that nobody has labelled."""
    source, target = (read_scan(data_folder / f'unlabelled/{side}.ply')
                      for side in ('source', 'target'))
    truth = np.vstack((np.loadtxt(data_folder / 'unlabelled/T_target_source.txt')
                       .reshape(-1, 4)[:3], [0, 0, 0, 1]))
    result = register(source, target)
    assert_right(result, truth, 0.1, 0.5)
    assert not result.warnings    # no ground labels are no news where there are none at all
    assert preprocess(source).ground.source == 'geometry'
    assert_right(register(target, source), np.linalg.inv(truth), 0.1, 0.5)


def test_indoor_fragments(data_folder):
    """Two fragments of a kitchen without labels, by the indoor preset."""
    lines = (data_folder / 'indoor/7-scenes-redkitchen_gt.log').read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.split()[:2] == ['0', '4'])
    truth = np.array([line.split() for line in lines[at + 1:at + 5]], float)
    config = SgorConfig.indoor()
    source, target = (preprocess(read_scan(data_folder / f'indoor/cloud_bin_{i}.ply'), config)
                      for i in (4, 0))
    assert_right(register(source, target, config), truth, 0.1, 3.0)
    assert_right(register(target, source, config), np.linalg.inv(truth), 0.1, 3.0)
