"""Where in a map a scan was taken: `Place`, `Located`."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.verdict.result import Status
from ..edge import Edge

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Place:
    """A pose in the map that a scan may have been taken at.

    Attributes
    ----------
    T_map_sensor : (4, 4) float64
        Metres.
    covariance : (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z) in the map frame, m^2 and rad^2: that of the
        registration; what is unsure of the keyframe's own pose is not in it.
    confidence : float
        0 to 1, as of `Registration`.
    keyframe : int
        The node that it was registered to.
    """

    T_map_sensor: Array
    covariance: Array | None
    confidence: float
    keyframe: int


@dataclass(frozen=True, eq=False, repr=False)
class Located:
    """Where in a map a scan was taken.

    Attributes
    ----------
    status : Status
        REGISTERED, AMBIGUOUS where several places of the map fit, DEGENERATE where the scan slides
        along the place, or REFUSED.
    reason : str
        Why it is not found, in words; empty where it is.
    T_map_sensor : (4, 4) float64 or None
        Pose of the sensor in the map, metres. Without success a candidate to look at and not to
        use; None where there is none.
    covariance, confidence, keyframe
        As of `Place`; None without T_map_sensor.
    alternatives : tuple of Place
        The other places; not empty only where it is AMBIGUOUS.
    attempts : int
        Registrations that were tried.
    edges : tuple of Edge
        From keyframes that answered to the scan, which is node -1.
    """

    status: Status
    reason: str
    T_map_sensor: Array | None = None
    covariance: Array | None = None
    confidence: float = 0.0
    keyframe: int | None = None
    alternatives: tuple[Place, ...] = ()
    attempts: int = 0
    edges: tuple[Edge, ...] = ()

    @property
    def success(self) -> bool:
        """Whether the pose may be used: the status is REGISTERED."""
        return self.status is Status.REGISTERED

    def __repr__(self) -> str:
        if self.T_map_sensor is None:
            return f'Located({self.status}: {self.reason})'
        at = ' '.join(f'{v:.2f}' for v in self.T_map_sensor[:3, 3])
        return f'Located({self.status}{self.reason and ": "}{self.reason}, at {at} m)'
