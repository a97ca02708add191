"""A pose graph as a file of g2o, and the stamps of its nodes beside it."""
from collections.abc import Iterable
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..mapping.edge import Edge

Array = NDArray[np.float64]


def write_g2o(path: Path, poses: Mapping[int, Array], edges: Iterable[Edge]) -> None:
    """Write nodes and edges; the first node is fixed.

    Parameters
    ----------
    path : Path
    poses : mapping of int to (4, 4) array
        T_map_sensor of each node.
    edges : iterable of Edge
    """
    lines = [f'VERTEX_SE3:QUAT {node} {_numbers(_pose(T))}' for node, T in poses.items()]
    lines += [f'FIX {node}' for node in list(poses)[:1]]
    lines += [_edge_line(edge) for edge in edges]
    path.write_text('\n'.join(lines) + '\n')


def write_stamps(path: Path, stamps_ns: Mapping[int, int]) -> None:
    """Write node and stamp, nanoseconds, a line each."""
    path.write_text(''.join(f'{node} {stamp}\n' for node, stamp in stamps_ns.items()))


def _edge_line(edge: Edge) -> str:
    # translation first, in the frame of the source; of the rotation the vector part of the
    # quaternion, which is half the rotation vector
    turn = np.kron(np.diag([1, 0.5]), edge.T_target_source[:3, :3].T)
    information = np.linalg.inv(turn @ edge.covariance @ turn.T)
    numbers = (*_pose(edge.T_target_source), *information[np.triu_indices(6)])
    return f'EDGE_SE3:QUAT {edge.target} {edge.source} {_numbers(numbers)}'


def _pose(T: Array) -> tuple[float, ...]:
    return (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat())


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(f'{value:.12g}' for value in values)
