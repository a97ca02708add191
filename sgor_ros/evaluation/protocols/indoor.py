"""3DMatch and 3DLoMatch: fragments and ``gt.log``, or single depth maps of RGB-D frames."""
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.common import se3
from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...core.scan.scan import SemanticScan
from ...io.datasets import DriveScan
from ...io.scans import read_scan
from ..methods.interface import INDOOR_M
from ..metrics.registration_recall import INDOOR
from .pairs import Pair
from .protocol import Protocol

Array = NDArray[np.float64]

MILLIMETRE = 1e-3
MOST_DEPTH_M = 6.0


def threedmatch(folder: Path, logs: str = '*gt.log') -> Protocol:
    """Return the pairs of all scenes of a folder: ``SCENE/cloud_bin_N.ply`` and its ``gt.log``.

    The log lies in the scene's folder or beside it as ``SCENE-evaluation/gt.log`` or
    ``SCENE_gt.log``. Neighbours, whose fragments follow each other, do not count, as in the
    benchmark.
    """
    pairs: list[Pair] = []
    missing = 0
    found = sorted({*folder.rglob(logs)})
    if not found:
        raise InputError(f'{folder}: no gt.log of 3DMatch in it')
    for log in found:
        scene, fragments = _scene(log)
        for i, j, T in read_log(log):
            # the log maps fragment j into fragment i
            source, target = fragments / f'cloud_bin_{j}.ply', fragments / f'cloud_bin_{i}.ply'
            if j - i <= 1:
                continue
            if source.is_file() and target.is_file():
                pairs.append(Pair(_fragment(source), _fragment(target), T,
                                  name=f'{scene} {j} {i}', group=scene))
            else:
                missing += 1
    return Protocol('3dmatch', pairs, (INDOOR,), INDOOR_M, SgorConfig.indoor().paper_steps(),
                    missing)


def read_log(path: Path) -> Iterator[tuple[int, int, Array]]:
    """Yield (i, j, T_i_j) of a ``gt.log``: a line of three numbers and four rows each."""
    try:
        numbers = np.array(path.read_text().split(), np.float64)
        blocks = numbers.reshape(-1, 19)
    except (OSError, ValueError) as error:
        raise InputError(f'{path}: expected blocks of "i j n" and a 4x4 matrix: {error}'
                         ) from error
    for block in blocks:
        yield int(block[0]), int(block[1]), block[3:].reshape(4, 4)


def depth_frames(folder: Path, stride: int) -> Protocol:
    """Return pairs of depth maps `stride` frames apart, each cloud of one map alone.

    ``frame-NNNNNN.depth.png`` in millimetres, ``frame-NNNNNN.pose.txt`` (T_world_camera) and
    ``camera-intrinsics.txt`` in it or above; ``frame-NNNNNN.label.png`` gives labels.
    """
    intrinsics = next((path for place in (folder, folder.parent)
                       if (path := place / 'camera-intrinsics.txt').is_file()), None)
    depths = sorted(folder.glob('frame-*.depth.png'))
    if intrinsics is None or not depths:
        raise InputError(f'{folder}: expected frame-*.depth.png and camera-intrinsics.txt')
    K = np.loadtxt(intrinsics)
    pairs = []
    for target, source in zip(depths, depths[stride:], strict=False):
        T_i, T_j = (np.loadtxt(str(path).replace('.depth.png', '.pose.txt'))
                    for path in (target, source))
        name = f'{folder.name} {source.name[6:12]} {target.name[6:12]}'
        pairs.append(Pair(_depth(source, K), _depth(target, K), se3.inverse(T_i) @ T_j, name=name,
                          group=folder.name))
    return Protocol('depth_frames', pairs, (INDOOR,), INDOOR_M,
                    SgorConfig.indoor().paper_steps())


def cloud_of_depth(depth_m: NDArray[np.float64], K: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Project a depth map (H, W) into the camera's frame.

    Returns
    -------
    points : (N, 3) float64
    seen : (H, W) bool
        Where there was a depth; the points follow these pixels.
    """
    seen = (depth_m > 0) & (depth_m < MOST_DEPTH_M)
    v, u = np.nonzero(seen)
    z = depth_m[seen]
    return np.column_stack(((u - K[0, 2]) * z / K[0, 0], (v - K[1, 2]) * z / K[1, 1], z)), seen


def _depth(path: Path, K: Array) -> DriveScan:
    labels = Path(str(path).replace('.depth.png', '.label.png'))
    return DriveScan(path.stem, '3dmatch', 'semantickitti',
                 partial(_read_depth, path, labels if labels.is_file() else None, K))


def _read_depth(path: Path, labels: Path | None, K: Array) -> SemanticScan:
    from PIL import Image
    depth = np.asarray(Image.open(path), np.float64) * MILLIMETRE
    points, seen = cloud_of_depth(depth, K)
    return SemanticScan(points, None if labels is None
                        else np.asarray(Image.open(labels)).astype(np.int64)[seen])


def _fragment(path: Path) -> DriveScan:
    return DriveScan(path.stem, '3dmatch', 'semantickitti', partial(read_scan, path))


def _scene(log: Path) -> tuple[str, Path]:
    """Return the name of the scene and the folder of its fragments."""
    if log.name != 'gt.log':
        return log.name.removesuffix('gt.log').rstrip('_-'), log.parent
    if log.parent.name.endswith('-evaluation'):
        scene = log.parent.name.removesuffix('-evaluation')
        return scene, log.parent.parent / scene
    return log.parent.name, log.parent
