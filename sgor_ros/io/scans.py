"""Scans from files: KITTI and nuScenes .bin, .pcd, .ply, .npz, and .label beside them."""
from collections.abc import Callable
import math
from pathlib import Path
from typing import Any
import zipfile

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.scan.scan import SemanticScan
from .broken import readable
from .columns import Columns
from .pcd import read_pcd
from .ply import read_ply
from .pointcloud2 import whole_numbers

LABEL_NAMES = ('label', 'labels', 'class')

# float32 a point: without intensity; nuScenes, with the ring; with ring and time; KITTI
BIN_COLUMNS = {'.xyz.bin': 3, '.pcd.bin': 5, '.xyzirt.bin': 6, '.bin': 4}
BIN_ADVICE = 'Name it ' + ', '.join(f'{ending} ({columns} columns)' for ending, columns in
                                     BIN_COLUMNS.items()) + ', or save points and labels as .npz'
# of 118 real scans, other columns than the right ones are never below 4.7 times as smooth,
# shuffled ones never below 0.77; wrongly taken for 4, those of 5 and 6 are at 0.21 and less
SMOOTHER = 0.4
FEWEST_STEPS = 100

# bytes that are no scan rarely make coordinates of metres
LARGEST_COORDINATE_M = 1e6

# times that deflate can shorten, and a header of its own
MOST_EXPANSION = 1100

Arrays = tuple[NDArray[Any], NDArray[Any] | None]


def read_scan(path: str | Path, labels_path: str | Path | None = None) -> SemanticScan:
    """Read a scan, with labels from a file of their own or those that come with it.

    Parameters
    ----------
    path : str or Path
        ``.bin``: float32 x y z intensity, as in KITTI (``.pcd.bin``: and ring, as in nuScenes;
        ``.xyz.bin``: x y z alone; ``.xyzirt.bin``: x y z intensity ring time);
        ``.pcd`` (ascii, binary, compressed) or ``.ply``: labels are the field `label`, `labels`
        or `class`, of any type whose values are whole;
        ``.npz``: arrays `points` (N, 3) and, where there are any, `labels` (N,).
    labels_path : str or Path, optional
        uint32 a point (SemanticKITTI) or uint8 a point (nuScenes lidarseg), by its size. Goes
        before labels in the scan itself.

    Raises
    ------
    InputError
        No such file, not a scan, truncated, or labels that do not fit.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise InputError(f'{path}: not a scan; expected a name ending in {", ".join(READERS)}')
    if not path.is_file():
        raise InputError(f'{path}: no such file')
    points, labels = READERS[suffix](path)
    if labels_path is not None:
        labels = read_labels(labels_path, len(points))
    try:
        return SemanticScan(points, labels)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def read_labels(path: str | Path, count: int) -> NDArray[np.int64]:
    """Read `count` labels of uint32 or uint8.

    Raises
    ------
    InputError
        No such file, or a file of another length.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f'{path}: no such file')
    size = path.stat().st_size
    for dtype in (np.uint32, np.uint8):
        if size == count * np.dtype(dtype).itemsize:
            return np.fromfile(path, dtype).astype(np.int64)
    raise InputError(f'{path}: {size} bytes are neither uint32 ({4 * count} bytes) nor uint8 '
                     f'({count} bytes) labels of the {count} points of the scan')


def _read_bin(path: Path) -> Arrays:
    columns = next(count for ending, count in BIN_COLUMNS.items()
                   if path.name.lower().endswith(ending))
    size = path.stat().st_size
    if size == 0 or size % (4 * columns):
        others = [str(k) for k in sorted(BIN_COLUMNS.values())
                  if k != columns and size and size % (4 * k) == 0]
        raise InputError(f'{path}: {size} bytes are no points of {columns} float32 '
                         f'({4 * columns} bytes each); truncated, or not a scan'
                         + (f', or of {" or ".join(others)} columns: {BIN_ADVICE}'
                            if others else ''))
    values = np.fromfile(path, np.float32)
    points = values.reshape(-1, columns)[:, :3]
    _check_reach(points, f'{path}: a coordinate of', 'not a scan of float32 points')
    _check_columns(path, values, columns)
    return points, None


def _check_reach(points: NDArray[Any], what: str, so: str) -> None:
    largest = np.abs(points[np.isfinite(points)]).max(initial=0.0)
    if largest > LARGEST_COORDINATE_M:
        raise InputError(f'{what} {largest:.3g} m; {so}')


def _check_columns(path: Path, values: NDArray[np.float32], columns: int) -> None:
    """Refuse points that jump about where, with another number of columns, they do not.

    Sensors write neighbours one after the other. Misread, their columns take turns.
    """
    jump = _jump(values, columns)
    for other in BIN_COLUMNS.values():
        if other != columns and values.size % other == 0:
            least = _jump(values, other)
            if least < SMOOTHER * jump:
                raise InputError(
                    f'{path}: read as {columns} float32 a point, neighbours are {jump:.2g} m '
                    f'apart, as {other} {least:.2g} m: it has {other} columns. {BIN_ADVICE}')


def _jump(values: NDArray[np.float32], columns: int) -> float:
    """Return how far each point is from the one before, the median in metres along the axes."""
    points = values.reshape(-1, columns)[:, :3]
    with np.errstate(all='ignore'):    # misread, there is everything among them
        steps = np.abs(np.diff(points, axis=0)).sum(axis=1)
    return float(np.median(steps)) if len(steps) > FEWEST_STEPS else 0.0


def _read_npz(path: Path) -> Arrays:
    with readable(path):
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                if member.filename in ('points.npy', 'labels.npy'):
                    _check_member(archive, member)
        with np.load(path, allow_pickle=False) as arrays:
            if 'points' not in arrays:
                raise InputError(f'{path}: no array points; there are '
                                 f'{", ".join(arrays) or "none"}')
            return arrays['points'], arrays.get('labels')


def _check_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """Hold what the header of an array claims against what the archive can hold of it."""
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        shape, _, dtype = (np.lib.format.read_array_header_1_0(file) if version == (1, 0)
                           else np.lib.format.read_array_header_2_0(file))
        there = min(member.file_size, MOST_EXPANSION * member.compress_size) - file.tell()
        if math.prod(shape) * dtype.itemsize > there:
            raise InputError(f'{archive.filename}: {member.filename[:-4]} of shape {shape} is '
                             f'more than its {member.compress_size} bytes can hold')


def _read_columns(path: Path) -> Arrays:
    """Read .pcd and .ply."""
    try:
        columns = (read_pcd if path.suffix.lower() == '.pcd' else read_ply)(path)
        points = np.column_stack([_column(columns, axis, axis.upper()) for axis in 'xyz'])
        _check_reach(points, 'a coordinate of', 'not in the frame of a sensor, but perhaps of a '
                     'map (UTM), and float32 would round it')
        name = next((name for name in LABEL_NAMES if name in dict(columns)), None)
        if name is None:
            return points, None
        return points, whole_numbers(_column(columns, name), points, name)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def _column(columns: Columns, *names: str) -> NDArray[Any]:
    """Return the only column of a name, or of the other one."""
    found = [values for name, values in columns if name in names]
    if len(found) != 1:
        there = ', '.join(name for name, _ in columns)[:200]
        raise InputError(f'{len(found) or "no"} fields {names[0]} among {there or "none"}')
    return found[0]


READERS: dict[str, Callable[[Path], Arrays]] = {
    '.bin': _read_bin, '.pcd': _read_columns, '.ply': _read_columns, '.npz': _read_npz}
