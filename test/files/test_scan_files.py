"""Scans from files: what is written comes back, and what is no scan is refused in words."""
import io
import zipfile

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


@pytest.mark.parametrize(('name', 'columns'), [
    ('a.xyz.bin', 3), ('a.XYZ.bin', 3), ('a.xyzirt.bin', 6), ('a.bin', 4)])
def test_other_columns_can_be_named(tmp_path, scan, name, columns):
    check(read_scan(write_bin(tmp_path / name, scan[0], columns)), scan[0], None)


@pytest.mark.parametrize(('name', 'columns'), [
    ('a.bin', 3), ('a.bin', 5), ('a.bin', 6), ('a.pcd.bin', 4)])
def test_another_number_of_columns_is_noticed(tmp_path, street, name, columns):
    """Also where the size fits; and the same points shuffled say nothing, so they are read."""
    points = street[0][0][:12000].astype(np.float32)
    path = write_bin(tmp_path / name, points, columns)
    with pytest.raises(InputError, match=f'it has {columns} columns. Name it .xyz.bin'):
        read_scan(path)
    right = 5 if name == 'a.pcd.bin' else 4
    check(read_scan(write_bin(tmp_path / name, points, right)), points, None)
    shuffled = np.random.default_rng(0).permutation(points)
    check(read_scan(write_bin(tmp_path / name, shuffled, right)), shuffled, None)


def test_a_size_of_five_columns_is_told(tmp_path, scan):
    with pytest.raises(InputError, match=r'or of 5 columns: Name it .*, \.pcd\.bin \(5 columns\)'):
        read_scan(write_bin(tmp_path / 'a.bin', scan[0][:7], 5))


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
    ('a.npz', b'no archive', 'a.npz: cannot be read: File is not a zip'),
    ('a.ply', b'hello', 'no header of a .ply'),
    ('a.pcd', b'hello', 'no header of a .pcd'),
])
def test_no_scan(tmp_path, capfd, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says):
        read_scan(tmp_path / name)
    assert capfd.readouterr() == ('', ''), 'a library printed its warnings raw'


@pytest.mark.parametrize('suffix', ['bin', 'pcd', 'ply'])
def test_missing_file(tmp_path, suffix):
    with pytest.raises(InputError, match='no such file'):
        read_scan(tmp_path / f'a.{suffix}')


PCD = """VERSION .7
FIELDS x y z label
SIZE 4 4 4 2
TYPE F F F U
COUNT 1 1 1 1
WIDTH 2
HEIGHT 1
POINTS 2
DATA {}
"""
ROWS = '1 2 3 7\n4 5 6 9\n'
PLY = """ply
format {} 1.0
comment by hand
element vertex 2
property float x
property float y
property float z
property {} {}
element face 0
property list uchar int vertex_indices
end_header
"""
HAND = np.array([[1, 2, 3], [4, 5, 6]], np.float32)
PLY_TYPES = {'char': 'i1', 'uchar': 'u1', 'short': 'i2', 'ushort': 'u2', 'int': 'i4', 'uint': 'u4',
             'int8': 'i1', 'uint8': 'u1', 'int16': 'i2', 'uint16': 'u2', 'int32': 'i4',
             'uint32': 'u4', 'float': 'f4', 'double': 'f8'}


def records(code, order='<', labels=(7, 9)):
    values = np.zeros(2, [(axis, f'{order}f4') for axis in 'xyz'] + [('label', order + code)])
    for axis, column in zip('xyz', HAND.T, strict=True):
        values[axis] = column
    values['label'] = labels
    return values.tobytes()


def written(path, *parts):
    path.write_bytes(b''.join(p if isinstance(p, bytes) else p.encode() for p in parts))
    return path


@pytest.mark.parametrize('kind', ['ascii', 'binary_little_endian', 'binary_big_endian'])
@pytest.mark.parametrize('of', PLY_TYPES)
def test_ply_labels_of_any_type(tmp_path, kind, of):
    data = ROWS if kind == 'ascii' else records(PLY_TYPES[of], '>' if 'big' in kind else '<')
    path = written(tmp_path / 'a.ply', PLY.format(kind, of, 'label'), data)
    check(read_scan(path), HAND, [7, 9])
    path = written(tmp_path / 'a.ply', PLY.format(kind, of, 'ring'), data)
    check(read_scan(path), HAND, None)


@pytest.mark.parametrize(('kind', 'size'), [
    (kind, size) for kind in 'IUF' for size in (1, 2, 4, 8) if kind != 'F' or size >= 4])
def test_pcd_labels_of_any_type(tmp_path, kind, size):
    header = PCD.replace('4 4 4 2', f'4 4 4 {size}').replace('F F F U', f'F F F {kind}')
    check(read_scan(written(tmp_path / 'a.pcd', header.format('ascii'), ROWS)), HAND, [7, 9])
    data = records(f'{kind.lower()}{size}')
    check(read_scan(written(tmp_path / 'a.pcd', header.format('binary'), data)), HAND, [7, 9])


@pytest.mark.parametrize('spoil', [
    lambda text: text.replace('\n', '\r\n'),
    lambda text: text.replace('1 2 3 7', '1\t2  3 7 '),
    lambda text: '# a comment\n' + text.replace('.7', '.5').replace('FIELDS', 'COLUMNS'),
    lambda text: text.replace('COUNT 1 1 1 1\n', '').replace('POINTS 2\n', '')
    .replace('HEIGHT 1\n', ''),
    lambda text: text.replace('x y z label', 'X Y Z label'),
    lambda text: text.replace('x y z', 'x _ y z').replace('4 4 4', '4 1 4 4')
    .replace('F F F', 'F U F F').replace('1 1 1 1', '1 3 1 1 1').replace('1 2', '1 8 8 8 2')
    .replace('4 5', '4 8 8 8 5'),
])
def test_pcd_as_others_write_it(tmp_path, spoil):
    path = written(tmp_path / 'a.pcd', spoil(PCD.format('ascii') + ROWS))
    check(read_scan(path), HAND, [7, 9])


@pytest.mark.parametrize('options', [{'compressed': True}, {'write_ascii': True}, {}])
def test_pcd_of_open3d(tmp_path, street, options):
    points, labels, _ = street[0]
    path = write_open3d(tmp_path / 'a.pcd', points.astype(np.float32), labels, **options)
    check(read_scan(path), points.astype(np.float32), labels)


HUGE = 'WIDTH 99999999999\nHEIGHT 1\nPOINTS 99999999999'


@pytest.mark.parametrize(('spoil', 'says'), [
    (lambda t: t.replace('WIDTH 2\n', ''), 'no line WIDTH'),
    (lambda t: t.replace('FIELDS x y z label\n', ''), 'no line FIELDS'),
    (lambda t: t.replace('WIDTH 2\nHEIGHT 1\nPOINTS 2', HUGE), 'fewer than the 99999999999'),
    (lambda t: t.replace('POINTS 2', 'POINTS 3'), 'POINTS 3, but of WIDTH x HEIGHT 2 x 1'),
    (lambda t: t.replace('WIDTH 2', 'WIDTH -2'), 'WIDTH -2: not whole'),
    (lambda t: t.replace('WIDTH 2', 'WIDTH ' + '9' * 5000), 'not whole'),
    (lambda t: t.replace('SIZE 4 4 4 2', 'SIZE 4 4 4'), '4 FIELDS, but 3 of SIZE'),
    (lambda t: t.replace('SIZE 4 4 4 2', 'SIZE 4 4 4 3'), 'field label: no type of TYPE U'),
    (lambda t: t.replace('TYPE F F F U', 'TYPE F F F Q'), 'field label: no type of TYPE Q'),
    (lambda t: t.replace('COUNT 1 1 1', 'COUNT 99999999999 1 1'), 'bytes a point'),
    (lambda t: t.replace('COUNT 1 1 1', 'COUNT 2 1 1'), 'fewer than the 2'),
    (lambda t: t.replace('x y z', 'x y y'), '2 fields y among x, y, y, label'),
    (lambda t: t.replace('x y z label', 'x y z z'), '2 fields z among x, y, z, z'),
    (lambda t: t.replace('DATA', 'DATA nonsense'), 'DATA nonsense: not one of'),
])
@pytest.mark.parametrize('kind', ['ascii', 'binary', 'binary_compressed'])
def test_what_the_header_of_a_pcd_claims_is_checked(tmp_path, spoil, says, kind):
    packed = b'\x1d\0\0\0\x1c\0\0\0\x1b' + bytes(28)
    data = {'ascii': ROWS.encode(), 'binary': records('u2')}.get(kind, packed)
    path = written(tmp_path / 'a.pcd', spoil(PCD.format(kind)), data)
    if kind == 'binary_compressed' and 'fewer' in says:
        says = 'its data unpack to 28 bytes'
    with pytest.raises(InputError, match=f'a.pcd: .*({says})'):
        read_scan(path)


@pytest.mark.parametrize('rows', ['1 2 3\n4 5 6\n', '1 2 3 7\n4 5 6\n', '1 2 3 7\n',
                                  '1 2 3 7\n4 5 6 9\n1 2 3 7\n', '1,2,3,7\n4,5,6,9\n',
                                  '1 2 3 7\n4 five 6 9\n', ''])
def test_ascii_rows_are_as_the_header_says(tmp_path, rows):
    """No row is made up of what was in memory, and none is left out."""
    with pytest.raises(InputError, match=r'a\.pcd: .*row'):
        read_scan(written(tmp_path / 'a.pcd', PCD.format('ascii'), rows))


@pytest.mark.parametrize('packed', [
    b'\x03abcd', b'\xe0', b'\xff\xff\xff', b'\x40\x00', b'\x1f' + b'a' * 20, b''])
def test_broken_compression(tmp_path, packed):
    sizes = np.array([len(packed), 28], '<u4').tobytes()
    with pytest.raises(InputError, match=r'a\.pcd: '):
        read_scan(written(tmp_path / 'a.pcd', PCD.format('binary_compressed'), sizes, packed))


@pytest.mark.parametrize(('spoil', 'says'), [
    (lambda t: t.replace('vertex 2', 'vertex 99999999999'), 'fewer than the 99999999999'),
    (lambda t: t.replace('vertex 2', 'vertex -2'), 'element vertex -2: not a line'),
    (lambda t: t.replace('element vertex 2\n', ''), 'not a line of a header'),
    (lambda t: t.replace('property float z\n', ''), 'no fields z among x, y, label|rows'),
    (lambda t: t.replace('property float x', 'property half x'), 'property half x: not a line'),
    (lambda t: t.replace('property float x', 'property list uchar int x'), 'property list'),
    (lambda t: t.replace('element vertex', 'element corner'), 'no element vertex; there are'),
    (lambda t: t.replace('end_header', 'the end'), 'no lines ply and end_header'),
    (lambda t: t.replace('format', 'format pdf'), 'format pdf: not one of'),
])
@pytest.mark.parametrize('kind', ['ascii', 'binary_little_endian'])
def test_what_the_header_of_a_ply_claims_is_checked(tmp_path, spoil, says, kind):
    data = ROWS.encode() if kind == 'ascii' else records('u2')
    path = written(tmp_path / 'a.ply', spoil(PLY.format(kind, 'ushort', 'label')), data)
    with pytest.raises(InputError, match=f'a.ply: .*({says})'):
        read_scan(path)


def test_labels_that_are_no_numbers_of_classes(tmp_path):
    for value in ('0.5', 'nan', 'inf', '1e300'):
        text = PCD.replace('4 4 4 2', '4 4 4 8').replace('F F F U', 'F F F F').format('ascii')
        with pytest.raises(InputError, match=r'a\.pcd: label: .* is not a whole number'):
            read_scan(written(tmp_path / 'a.pcd', text, ROWS.replace('9', value)))


def test_coordinates_of_a_map_are_refused(tmp_path):
    """float32 would move them by half a metre."""
    rows = '493994.9 4877429.5 123.9 7\n493995.9 4877429.5 123.9 7\n'
    with pytest.raises(InputError, match=r'4\.88e\+06 m; not in the frame of a sensor'):
        read_scan(written(tmp_path / 'a.pcd', PCD.format('ascii'), rows))


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


def npz_claiming(path, shape, compression=zipfile.ZIP_STORED, spoil=False):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {'shape': shape, 'fortran_order': False, 'descr': '<f4'})
    with zipfile.ZipFile(path, 'w', compression) as archive:
        archive.writestr('points.npy', header.getvalue() + bytes(1200))
    if spoil:
        content = bytearray(path.read_bytes())
        content[60:90] = b'\xff' * 30
        path.write_bytes(content)
    return path


@pytest.mark.parametrize('shape', [(2**31, 3), (2**62, 2**62), (101, 3)])
@pytest.mark.parametrize('compression', [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_npz_that_claims_more_than_it_holds(tmp_path, shape, compression):
    with pytest.raises(InputError, match=r'a\.npz: points of shape .* is more than its'):
        read_scan(npz_claiming(tmp_path / 'a.npz', shape, compression))


def test_npz_with_broken_deflate(tmp_path):
    with pytest.raises(InputError, match=r'a\.npz: cannot be read: '):
        read_scan(npz_claiming(tmp_path / 'a.npz', (100, 3), zipfile.ZIP_DEFLATED, spoil=True))


def test_npz_packed_in_an_unknown_way(tmp_path):
    path = npz_claiming(tmp_path / 'a.npz', (100, 3))
    content = path.read_bytes()
    directory = content.index(b'PK\1\2')
    path.write_bytes(content[:directory + 10] + b'\x63' + content[directory + 11:])
    with pytest.raises(InputError, match=r'a\.npz: cannot be read: .*compression'):
        read_scan(path)


def test_npz_without_points(tmp_path):
    np.savez(tmp_path / 'a.npz', cloud=np.zeros((3, 3)))
    with pytest.raises(InputError, match='no array points; there are cloud'):
        read_scan(tmp_path / 'a.npz')


@pytest.mark.parametrize('size', [0, COUNT - 1, 4 * COUNT - 4, 2 * COUNT])
def test_labels_of_another_length(tmp_path, scan, size):
    (tmp_path / 'a.label').write_bytes(b'\0' * size)
    with pytest.raises(InputError, match=f'{size} bytes are neither uint32 .2000 bytes'):
        read_scan(write_bin(tmp_path / 'a.bin', scan[0]), tmp_path / 'a.label')


ODD = {
    'ascii_with_underscore.pcd': 213, 'binary.pcd': 213, 'colored_cloud.pcd': 1000,
    'left-2022-02-15-17-36-04-414.pcd': 9192, 'milk_color.pcd': 13704,
    'simple_binary.ply': 3, 'text_extradim.ply': 1,
    'autzen-utm.pcd': 'a coordinate of .* m; not in the frame of a sensor',
    'missingheader.pcd': 'no header of a .pcd file: it has no line DATA',
    'utm17_comma.pcd': "not 3 numbers in each row: .*'289814.15,4320978.61,170.76'",
    'cloudini_pointcloud2_cdr.bin': '1664200 bytes are no points of 4 float32'}


def test_odd_files_are_read_or_refused_for_a_true_reason(data_folder):
    files = {path.name: path for path in (data_folder / 'odd').iterdir()}
    assert set(files) == set(ODD)
    for name, expected in ODD.items():
        if isinstance(expected, int):
            assert len(read_scan(files[name])) == expected
        else:
            with pytest.raises(InputError, match=expected):
                read_scan(files[name])


@pytest.mark.parametrize('name', [
    'ascii_with_underscore.pcd', 'binary.pcd', 'colored_cloud.pcd', 'milk_color.pcd',
    'left-2022-02-15-17-36-04-414.pcd', 'simple_binary.ply'])
def test_odd_files_are_read_as_open3d_reads_them(data_folder, name):
    o3d = pytest.importorskip('open3d')
    path = data_folder / 'odd' / name
    expected = o3d.t.io.read_point_cloud(str(path)).point.positions.numpy()
    np.testing.assert_array_equal(read_scan(path).points, expected)


def test_no_real_scan_is_taken_for_one_of_other_columns(data_folder):
    files = [*data_folder.rglob('velodyne/*.bin'), *data_folder.glob('ouster/*.bin'),
             *data_folder.parent.glob('drives/*/velodyne/*.bin')]
    assert len(files) > 30
    for path in files:
        assert len(read_scan(path)) > 1000


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
