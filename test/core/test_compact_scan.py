"""Prepared scans pickle; their compact form is small, fits a file, and registers alike."""
import pickle

import numpy as np
import pytest

from sgor_ros import InputError
from sgor_ros import open_drive
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.compact_scan import compact
from sgor_ros.io.compact_scans import read_compact_scan
from sgor_ros.io.compact_scans import write_compact_scan


@pytest.fixture(scope='module')
def pair(street):
    """Return two scans of the street, the second one prepared."""
    target, source = (SemanticScan(*scan[:2]) for scan in street[:2])
    return source, preprocess(target)


def same(one, other, tolerance=0.0):
    assert one.status is other.status
    assert one.confidence == other.confidence
    assert one.inliers.sum() == other.inliers.sum() > 0
    for name in ('T_target_source', 'covariance'):
        mine, theirs = getattr(one, name), getattr(other, name)
        assert (mine is None) == (theirs is None)
        if mine is not None:
            assert np.abs(mine - theirs).max() <= tolerance
    assert len(one.alternatives) == len(other.alternatives)
    assert len(one.degenerate) == len(other.degenerate)


@pytest.mark.parametrize('used', [False, True], ids=['fresh', 'used'])
def test_a_prepared_scan_pickles_to_the_same_bits(pair, used):
    source, _ = pair
    prepared = preprocess(source)
    before = register(prepared, pair[1])
    assert before.success
    again = pickle.loads(pickle.dumps(prepared if used else preprocess(source)))
    assert again.config == prepared.config
    same(before, register(again, pair[1]))
    same(register(pair[1], prepared), register(pair[1], again))


@pytest.mark.parametrize('way', ['file', 'pickle'])
def test_a_compact_scan_registers_alike(pair, tmp_path, way):
    source, target = pair
    small = compact(target)
    if way == 'file':
        write_compact_scan(tmp_path / 'scan.npz', small)
        assert (tmp_path / 'scan.npz').stat().st_size < 1.02 * small.nbytes + 5000
        small = read_compact_scan(tmp_path / 'scan.npz')
    else:
        small = pickle.loads(pickle.dumps(small))
    restored = small.restored()
    assert restored.config == target.config
    same(register(source, target), register(source, restored), 1e-6)
    same(register(target, source), register(restored, source), 1e-6)


def test_real_scans_register_alike_and_are_a_seventh(data_folder):
    drive = open_drive(data_folder / 'kitti/08')
    source, scan = drive.read(3), drive.read(0)
    target = preprocess(scan)
    small = compact(target)
    assert small.nbytes < len(pickle.dumps(target)) / 7
    same(register(source, target), register(source, small.restored()), 1e-6)
    bare = SemanticScan(source.points), preprocess(SemanticScan(scan.points))
    same(register(*bare), register(bare[0], compact(bare[1]).restored()), 1e-6)


def test_keypoints_of_the_caller_keep_their_descriptors(street):
    rng = np.random.default_rng(0)
    scan = SemanticScan(*street[0][:2])
    keypoints = scan.points[rng.choice(len(scan), 800, replace=False)].astype(np.float64)
    prepared = preprocess(scan, keypoints=keypoints, descriptors=rng.normal(size=(800, 8)))
    restored = compact(prepared).restored()
    assert restored.features.descriptors.shape[1] == 8
    assert np.array_equal(restored.features.descriptors, prepared.features.descriptors)
    same(register(prepared, prepared), register(prepared, restored), 1e-6)


def test_what_follows_is_made_again_exactly(pair):
    _, target = pair
    restored = compact(target).restored()
    for mine, theirs in ((target.features, restored.features), (target.index, restored.index),
                         (target.index.columns, restored.index.columns),
                         (target.index.birds_eye_view, restored.index.birds_eye_view)):
        names = [name for name in vars(mine) if isinstance(vars(mine)[name], np.ndarray)]
        assert names
        for name in names:
            assert np.array_equal(getattr(mine, name), getattr(theirs, name)), name
    assert np.array_equal(target.features.descriptors, restored.features.descriptors)
    assert np.array_equal(target.features.context, restored.features.context)
    assert np.abs(target.surface.columns.points - restored.surface.columns.points).max() < 1e-5


def test_another_scale_or_configuration_is_refused(pair):
    source, target = pair
    restored = compact(target).restored()
    finer = preprocess(source, SgorConfig(scale=2.0))
    with pytest.raises(InputError, match='compact scan has no points'):
        register(finer, restored)
    with pytest.raises(InputError, match='voxel_size'):
        register(source, restored, SgorConfig(voxel_size=0.4))


@pytest.mark.parametrize(('change', 'words'), [
    (lambda a: a.pop('points'), 'points: missing'),
    (lambda a: a.update(points=a['points'].astype(np.float32)), 'points: expected float64'),
    (lambda a: a.update(normals=a['normals'][1:]), 'normals: expected float64'),
    (lambda a: a.update(labels=a['labels'][:, None]), 'labels: expected uint8'),
    (lambda a: a.update(points=np.full_like(a['points'], np.nan)), 'points: not all are finite'),
    (lambda a: a.update(ranges=a['ranges'][1:]), 'ranges: '),
    (lambda a: a.update(plane=np.zeros(3)), 'plane: 3 numbers'),
    (lambda a: a.update(about=np.frombuffer(b'{"version": 2}', np.uint8)), 'version = 2'),
    (lambda a: a.update(about=np.frombuffer(b'{', np.uint8)), 'about: '),
    (lambda a: a.update(about=np.frombuffer(b'{"version": 1}', np.uint8)), 'about: '),
    (lambda a: a.pop('about'), 'about: ')])
def test_what_is_wrong_with_a_file_is_named(pair, tmp_path, change, words):
    arrays = compact(pair[1]).as_arrays()
    change(arrays)
    path = tmp_path / 'scan.npz'
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=rf'scan\.npz: {words}'):
        read_compact_scan(path)


def test_other_files_are_refused(tmp_path):
    path = tmp_path / 'scan.npz'
    with pytest.raises(InputError, match=r'scan\.npz: cannot be read'):
        read_compact_scan(path)
    for content in (b'', b'PK\3\4', b'\x93NUMPY', b'words'):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r'scan\.npz: cannot be read'):
            read_compact_scan(path)
    np.savez(path, about=np.array([{}], dtype=object))
    with pytest.raises(InputError, match=r'scan\.npz: '):
        read_compact_scan(path)
