"""The pose of every scan on a node of the graph, in little memory."""
from array import array
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROW = 12
"""Numbers of a pose: the last row of each is the same."""


class ScanPoses:
    """Stamp, node and pose of each scan, in the order of tracking: 112 bytes a scan."""

    def __init__(self) -> None:
        self._stamps_ns = array('q')
        self._nodes = array('q')
        self._T_node_sensor = array('d')

    def __len__(self) -> int:
        return len(self._nodes)

    def add(self, stamp_ns: int, node: int, T_node_sensor: Array) -> None:
        """Take one more scan, at a pose (4, 4) seen from a node."""
        self._stamps_ns.append(stamp_ns)
        self._nodes.append(node)
        self._T_node_sensor.extend(T_node_sensor[:3].ravel().tolist())

    def last(self) -> tuple[int, Array]:
        """Return node and T_node_sensor, (4, 4), of the newest scan."""
        return self._nodes[-1], _poses(self._T_node_sensor[-ROW:])[0]

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """The stamps, (N,) int64, nanoseconds."""
        return np.array(self._stamps_ns, np.int64)

    @property
    def nodes(self) -> NDArray[np.int64]:
        """The node of each, (N,) int64."""
        return np.array(self._nodes, np.int64)

    @property
    def T_node_sensor(self) -> Array:
        """The pose of each seen from its node, (N, 4, 4)."""
        return _poses(self._T_node_sensor)

    def move(self, bases: Mapping[int, tuple[int, Array]]) -> None:
        """Put the scans of some nodes on others.

        Parameters
        ----------
        bases : mapping of int to (int, (4, 4) array)
            For each node that is left the other one, and T_other_node.
        """
        for scan in np.flatnonzero(np.isin(self.nodes, list(bases))).tolist():
            part = slice(ROW * scan, ROW * (scan + 1))
            other, T_other_node = bases[self._nodes[scan]]
            T = T_other_node @ _poses(self._T_node_sensor[part])[0]
            self._nodes[scan] = other
            self._T_node_sensor[part] = array('d', T[:3].ravel().tolist())


def _poses(numbers: 'array[float]') -> Array:
    poses = np.zeros((len(numbers) // ROW, 4, 4))
    poses[:, :3] = np.array(numbers, np.float64).reshape(-1, 3, 4)
    poses[:, 3, 3] = 1.0
    return poses
