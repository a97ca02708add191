"""A relative pose between two nodes of the graph, with its covariance."""
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3

Array = NDArray[np.float64]


NO_NODE = -1
"""In place of the node of a scan that is in no graph."""


class Kind(StrEnum):
    """Where an edge comes from."""

    ODOMETRY = 'odometry'
    LOOP = 'loop'


@dataclass(frozen=True, eq=False)
class Edge:
    """Where one node of the graph lies, seen from another.

    Attributes
    ----------
    target, source : int
        Nodes.
    T_target_source : (4, 4) float64
        Metres.
    covariance : (6, 6) float64
        Of (x, y, z, rotation about x, y, z) in the target frame, m^2 and rad^2.
    kind : Kind
    """

    target: int
    source: int
    T_target_source: Array
    covariance: Array
    kind: Kind = Kind.ODOMETRY

    def reversed(self) -> 'Edge':
        """Return the same seen from the source."""
        T = self.T_target_source
        J = se3.turned(T[:3, :3].T) @ se3.carried(-T[:3, 3])    # its sign cancels
        return Edge(self.source, self.target, se3.inverse(T), J @ self.covariance @ J.T, self.kind)


def chained(edges: list[Edge]) -> tuple[Array, Array]:
    """Return pose and covariance of the last node seen from the first, of edges end to end.

    Each leads from its target on to its source. Their errors are independent of each other.

    Returns
    -------
    (4, 4) float64, (6, 6) float64
    """
    poses = np.empty((len(edges) + 1, 4, 4))
    poses[0] = np.eye(4)
    for k, edge in enumerate(edges):
        poses[k + 1] = poses[k] @ edge.T_target_source
    if not edges:
        return poses[0], np.zeros((6, 6))
    # an error of an edge moves all that comes after, by the lever to the end
    R, lever = poses[:-1, :3, :3], poses[-1, :3, 3] - poses[1:, :3, 3]
    x, y, z = lever.T
    zero = np.zeros(len(edges))
    arm = np.stack((zero, z, -y, -z, zero, x, y, -x, zero), axis=-1).reshape(-1, 3, 3)
    J = np.zeros((len(edges), 6, 6))
    J[:, :3, :3] = J[:, 3:, 3:] = R
    J[:, :3, 3:] = arm @ R
    covariance = (J @ np.array([edge.covariance for edge in edges])
                  @ J.transpose(0, 2, 1)).sum(axis=0)
    return poses[-1], (covariance + covariance.T) / 2


def squared_distance(T: Array, other: Array, covariance: Array) -> float:
    """Return the squared Mahalanobis distance of two (4, 4) poses, by that of their difference."""
    d = se3.perturbation(T, other)
    return float(d @ np.linalg.solve(covariance, d))
