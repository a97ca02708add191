"""Scans from files: KITTI and nuScenes .bin, .pcd, .ply, .npz, and .label beside them."""
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import redirect_stdout
import io
import os
from pathlib import Path
import re
from typing import Any
import zipfile

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.scan.scan import SemanticScan
from .pointcloud2 import whole_numbers

LABEL_NAMES = ('label', 'labels', 'class')

# bytes that are no scan rarely make coordinates of metres
LARGEST_COORDINATE_M = 1e6

Arrays = tuple[NDArray[Any], NDArray[Any] | None]


def read_scan(path: str | Path, labels_path: str | Path | None = None) -> SemanticScan:
    """Read a scan, with labels from a file of their own or those that come with it.

    Parameters
    ----------
    path : str or Path
        ``.bin``: float32 x y z intensity, as in KITTI (``.pcd.bin``: and ring, as in nuScenes);
        ``.pcd`` or ``.ply``: labels are the attribute `label`, `labels` or `class`;
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
    columns = 5 if path.name.endswith('.pcd.bin') else 4
    size = path.stat().st_size
    if size == 0 or size % (4 * columns):
        raise InputError(f'{path}: {size} bytes are no points of {columns} float32 '
                         f'({4 * columns} bytes each); truncated, or not a scan')
    points = np.fromfile(path, np.float32).reshape(-1, columns)[:, :3]
    largest = np.abs(points[np.isfinite(points)]).max(initial=0.0)
    if largest > LARGEST_COORDINATE_M:
        raise InputError(f'{path}: a coordinate of {largest:.3g} m; not a scan of float32 points')
    return points, None


def _read_npz(path: Path) -> Arrays:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            if 'points' not in arrays:
                raise InputError(f'{path}: no array points; there are '
                                 f'{", ".join(arrays) or "none"}')
            return arrays['points'], arrays.get('labels')
    except InputError:
        raise
    except (OSError, EOFError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f'{path}: not a readable .npz file: {error}') from error


def _read_open3d(path: Path) -> Arrays:
    """Read .pcd and .ply; Open3D only prints a warning where it fails, so listen to that."""
    try:
        import open3d as o3d
    except ImportError as error:
        raise InputError(f'{path}: reading {path.suffix} needs Open3D: '
                         f"pip install 'sgor_ros[open3d]' ({error})") from error
    said = io.StringIO()
    try:
        with redirect_stdout(said), _silent_stderr():
            cloud = o3d.t.io.read_point_cloud(path)
    except RuntimeError as error:
        raise InputError(f'{path}: {_plain(str(error))}') from error
    if said.getvalue() or 'positions' not in cloud.point:
        raise InputError(f'{path}: not a readable scan: '
                         f'{_plain(said.getvalue()) or "it has no points"}')
    points = cloud.point.positions.numpy()
    _check_ascii_pcd(path, len(points))
    name = next((name for name in LABEL_NAMES if name in cloud.point), None)
    if name is None:
        return points, None
    labels = cloud.point[name].numpy().reshape(-1)
    return points, whole_numbers(labels, points, f'{path}: {name}')


def _check_ascii_pcd(path: Path, count: int) -> None:
    """Open3D says nothing about missing rows and returns what was in memory."""
    content = path.read_bytes() if path.suffix.lower() == '.pcd' else b''
    _, ascii_data, rows = content.partition(b'DATA ascii')
    if ascii_data and len(rows.split(b'\n')) - 2 < count - (not rows.endswith(b'\n')):
        raise InputError(f'{path}: fewer than the {count} rows that its header tells; truncated')


@contextmanager
def _silent_stderr() -> Iterator[None]:
    """Keep what C code prints off the terminal."""
    keep = os.dup(2)
    try:
        with open(os.devnull, 'wb') as nowhere:
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        os.dup2(keep, 2)
        os.close(keep)


def _plain(message: str) -> str:
    """Return a message of Open3D without colours, prefixes and source lines."""
    text = re.sub(r'\x1b\[[0-9;]*m|\[Open3D \w+\]|\(.*?\) /\S+:\d+:', '', message)
    return '; '.join(line.strip() for line in text.splitlines() if line.strip())


READERS: dict[str, Callable[[Path], Arrays]] = {
    '.bin': _read_bin, '.pcd': _read_open3d, '.ply': _read_open3d, '.npz': _read_npz}
