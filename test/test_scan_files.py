"""Scans from files: what is written comes back, and what is no scan is refused in words."""
import numpy as np
import pytest

from sgor_ros import InputError
from sgor_ros.io.scans import read_scan

COUNT = 500


@pytest.fixture
def scan():
    rng = np.random.default_rng(1)
    return (rng.normal(0, 20, (COUNT, 3)).astype(np.float32),
            rng.integers(0, 100, COUNT).astype(np.uint32))


def write_open3d(path, points, labels, name='label', dtype=np.uint16, **options):
    o3d = pytest.importorskip('open3d')
    cloud = o3d.t.geometry.PointCloud(points)
    if labels is not None:
        cloud.point[name] = labels.astype(dtype)[:, None]
    assert o3d.t.io.write_point_cloud(str(path), cloud, **options)
    return path


def write_bin(path, points, columns=4):
    extra = np.ones((len(points), columns - 3), np.float32)
    np.hstack((points, extra)).tofile(path)
    return path


def check(result, points, labels):
    np.testing.assert_array_equal(result.points, points)
    if labels is None:
        assert result.labels is None
    else:
        np.testing.assert_array_equal(result.labels, labels)


@pytest.mark.parametrize('dtype', [np.uint32, np.uint8])
def test_bin_with_labels(tmp_path, scan, dtype):
    points, labels = scan
    labels.astype(dtype).tofile(tmp_path / 'a.label')
    check(read_scan(write_bin(tmp_path / 'a.bin', points), tmp_path / 'a.label'), points, labels)


def test_labels_are_used_only_when_given(tmp_path, scan):
    points, labels = scan
    labels.tofile(tmp_path / 'a.label')
    check(read_scan(write_bin(tmp_path / 'a.bin', points)), points, None)


def test_nuscenes_has_five_columns(tmp_path, scan):
    check(read_scan(write_bin(tmp_path / 'a.pcd.bin', scan[0], 5)), scan[0], None)


def test_npz(tmp_path, scan):
    points, labels = scan
    np.savez(tmp_path / 'a.npz', points=points, labels=labels)
    check(read_scan(tmp_path / 'a.npz'), points, labels)
    np.savez(tmp_path / 'b.npz', points=points)
    check(read_scan(tmp_path / 'b.npz'), points, None)


@pytest.mark.parametrize('suffix', ['ply', 'pcd'])
@pytest.mark.parametrize(('name', 'dtype'), [
    ('label', np.uint16), ('labels', np.int32), ('class', np.uint8), ('label', np.float32)])
def test_open3d_formats_with_labels(tmp_path, scan, suffix, name, dtype):
    path = write_open3d(tmp_path / f'a.{suffix}', *scan, name, dtype)
    check(read_scan(path), *scan)


@pytest.mark.parametrize('suffix', ['ply', 'pcd'])
def test_given_labels_go_before_those_in_the_file(tmp_path, scan, suffix):
    points, labels = scan
    (labels + 1).tofile(tmp_path / 'a.label')
    path = write_open3d(tmp_path / f'a.{suffix}', points, labels)
    check(read_scan(path, tmp_path / 'a.label'), points, labels + 1)


@pytest.mark.parametrize(('name', 'content', 'says'), [
    ('a.txt', b'1 2 3', 'not a scan; expected a name ending in .bin, .pcd'),
    ('a.bin', b'', '0 bytes'),
    ('a.bin', b'x' * 33, '33 bytes are no points of 4 float32'),
    ('a.bin', b'this is text, and not 16 floats.' * 10, 'not a scan of float32'),
    ('a.bin', np.full(8, np.nan, np.float32).tobytes(), 'none of 2 is finite'),
    ('a.npz', b'no archive', 'not a readable .npz'),
    ('a.ply', b'hello', 'not a readable scan'),
    ('a.pcd', b'hello', 'not a readable scan'),
])
def test_no_scan(tmp_path, capfd, name, content, says):
    if name.endswith(('ply', 'pcd')):
        pytest.importorskip('open3d')
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says):
        read_scan(tmp_path / name)
    assert capfd.readouterr() == ('', ''), 'a library printed its warnings raw'


@pytest.mark.parametrize('suffix', ['bin', 'pcd', 'ply'])
def test_missing_file(tmp_path, suffix):
    with pytest.raises(InputError, match='no such file'):
        read_scan(tmp_path / f'a.{suffix}')


@pytest.mark.parametrize('suffix', ['ply', 'pcd'])
@pytest.mark.parametrize('ascii_format', [False, True])
def test_truncated_clouds_are_refused(tmp_path, capfd, scan, suffix, ascii_format):
    path = write_open3d(tmp_path / f'a.{suffix}', *scan, write_ascii=ascii_format)
    check_points = read_scan(path).points
    np.testing.assert_allclose(check_points, scan[0], rtol=1e-5)
    content = path.read_bytes()
    for length in (0.5, 0.97):
        path.write_bytes(content[:int(length * len(content))])
        with pytest.raises(InputError, match=f'a.{suffix}: '):
            read_scan(path)
    assert capfd.readouterr() == ('', '')


def test_npz_without_points(tmp_path):
    np.savez(tmp_path / 'a.npz', cloud=np.zeros((3, 3)))
    with pytest.raises(InputError, match='no array points; there are cloud'):
        read_scan(tmp_path / 'a.npz')


@pytest.mark.parametrize('size', [0, COUNT - 1, 4 * COUNT - 4, 2 * COUNT])
def test_labels_of_another_length(tmp_path, scan, size):
    (tmp_path / 'a.label').write_bytes(b'\0' * size)
    with pytest.raises(InputError, match=f'{size} bytes are neither uint32 .2000 bytes'):
        read_scan(write_bin(tmp_path / 'a.bin', scan[0]), tmp_path / 'a.label')


def test_real_scans(data_folder):
    kitti = data_folder / 'kitti/08'
    scan = read_scan(kitti / 'velodyne/000000.bin', kitti / 'labels/000000.label')
    assert len(scan) == 123389
    assert {40, 70} < set(np.unique(scan.labels & 0xFFFF))    # road and vegetation
    assert 60 < np.abs(scan.points).max() < 120
    ply = read_scan(data_folder / 'unlabelled/source.ply')
    assert len(ply) == 69792
    assert ply.labels is None
    nuscenes = data_folder / 'nuscenes'
    scan = read_scan(nuscenes / 'velodyne/000000.bin', nuscenes / 'labels/000000.label')
    assert (scan.labels == 31).sum() > 5000    # the ego vehicle
