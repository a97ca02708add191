"""How errors of steps add up along a track: noise in squares, correlated errors as they repeat."""
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..core.common import se3

Array = NDArray[np.float64]

CORRELATION_LENGTHS_M = np.array([50.0, 50.0, 50.0, 2.0, 2.0, 2.0])
"""Ways over which correlated errors (x, y, z, rotation about x, y, z) stay alike: those of
translation as long as the speed does, those of rotation as long as the surroundings do."""


@dataclass(frozen=True, eq=False)
class PoseCovariance:
    """Covariance of a pose in the odom frame, and what it shares with the errors to come.

    The correlated part of a step is S b, with S from the registration and b six numbers of unit
    variance that decay along the way (a Gauss-Markov process). The pose is correlated with b,
    which is why the next step, with nearly the same b, adds more than its square.

    Attributes
    ----------
    pose : (6, 6) float64
    shared : (6, 6) float64
        Covariance of the pose's error with b.
    """

    pose: Array
    shared: Array

    @classmethod
    def origin(cls) -> Self:
        """Return that of the first scan of a track, where it is by definition."""
        return cls(np.zeros((6, 6)), np.zeros((6, 6)))

    def then(self, T_odom_reference: Array, T_reference_scan: Array, step: Array,
             correlated_error: Array | None) -> Self:
        """Return the covariance after a step.

        All perturb from the left. Translation parts are of the moved origin, so a rotation error
        of the reference moves the scan by the lever arm to it.

        Parameters
        ----------
        T_odom_reference, T_reference_scan : (4, 4) float64
        step : (6, 6) float64
            Covariance of the step in the reference frame, correlated part included.
        correlated_error : (6, 6) float64 or None
            Square root of that part.
        """
        R = T_odom_reference[:3, :3]
        carry, turn = se3.carried(R @ T_reference_scan[:3, 3]), se3.turned(R)
        way = float(np.linalg.norm(T_reference_scan[:3, 3]))
        shared = carry @ self.shared * np.exp(-way / CORRELATION_LENGTHS_M)
        root = turn @ (np.zeros((6, 6)) if correlated_error is None else correlated_error)
        cross = shared @ root.T
        pose = carry @ self.pose @ carry.T + turn @ step @ turn.T + cross + cross.T
        return type(self)((pose + pose.T) / 2, shared + root)
