"""The cloud of a map as .ply and .pcd, coloured by label."""
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .colours import GREY
from .colours import SERIES

PALETTE = np.array([[int(colour[i:i + 2], 16) for i in (1, 3, 5)]
                    for colour in (GREY, *(colour for colour, *_ in SERIES))], np.uint8)
"""Grey for what has no label, then the classes in turns."""


def write_map_ply(path: Path, points: NDArray[np.float32], labels: NDArray[np.uint8]) -> None:
    """Write (N, 3) points, metres, with classes (N,) as colours and as `label`."""
    rows = np.empty(len(points), [('xyz', '<f4', 3), ('rgb', 'u1', 3), ('label', 'u1')])
    rows['xyz'], rows['rgb'], rows['label'] = points, _colours(labels), labels
    names = [*(f'float {name}' for name in 'xyz'), 'uchar red', 'uchar green', 'uchar blue',
             'uchar label']
    header = ['ply', 'format binary_little_endian 1.0', f'element vertex {len(rows)}',
              *(f'property {name}' for name in names), 'end_header', '']
    path.write_bytes('\n'.join(header).encode() + rows.tobytes())


def write_map_pcd(path: Path, points: NDArray[np.float32], labels: NDArray[np.uint8]) -> None:
    """Write the same for PCL, whose `rgb` is one packed number."""
    rows = np.empty(len(points), [('xyz', '<f4', 3), ('rgb', '<u4'), ('label', '<u4')])
    red, green, blue = _colours(labels).astype(np.uint32).T
    rows['xyz'], rows['rgb'], rows['label'] = points, red << 16 | green << 8 | blue, labels
    header = ['# .PCD v0.7', 'VERSION 0.7', 'FIELDS x y z rgb label', 'SIZE 4 4 4 4 4',
              'TYPE F F F U U', 'COUNT 1 1 1 1 1', f'WIDTH {len(rows)}', 'HEIGHT 1',
              'VIEWPOINT 0 0 0 1 0 0 0', f'POINTS {len(rows)}', 'DATA binary', '']
    path.write_bytes('\n'.join(header).encode() + rows.tobytes())


def _colours(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    rows = np.where(labels == 0, 0, 1 + (labels.astype(np.int64) - 1) % (len(PALETTE) - 1))
    chosen: NDArray[np.uint8] = PALETTE[rows]
    return chosen
