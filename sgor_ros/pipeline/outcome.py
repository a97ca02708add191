"""What became of a scan: in full for those who watch, as a row for those who add up."""
from dataclasses import dataclass
from dataclasses import field
import math

import numpy as np
from numpy.typing import NDArray

from ..core.scan.scan import SemanticScan
from ..tracker import TrackedScan


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the pipeline made of one scan.

    Attributes
    ----------
    stamp_ns : int
    frame : str
        Of the sensor; empty where neither the scan nor the configuration names it.
    reason : str
        Why no pose is published; empty where one is.
    scan : SemanticScan or None
        None where it could not be read.
    tracked : TrackedScan or None
        With the pose of the sensor in the frame of its track; None where the cloud is unusable:
        it could not be read, or it brought about a fault of the program.
    T_odom_child : (4, 4) float64 or None
        The pose that is published, of the base or of the sensor.
    seconds : float
        For decoding and tracking; NaN for an unusable cloud.
    """

    stamp_ns: int
    frame: str
    reason: str = ''
    scan: SemanticScan | None = None
    tracked: TrackedScan | None = None
    T_odom_child: NDArray[np.float64] | None = None
    seconds: float = math.nan

    def row(self) -> 'Row':
        """Return what is worth keeping of a scan of many."""
        if self.tracked is None:
            return Row(self.stamp_ns, self.reason)
        step = self.tracked.registration
        return Row(self.stamp_ns, self.reason, self.T_odom_child, self.tracked.restarted,
                   math.nan if step is None else step.confidence, self.seconds,
                   self.tracked.timings, self.tracked.track_id)


@dataclass(frozen=True, eq=False)
class Row:
    """One line of the summary of a drive.

    Attributes
    ----------
    stamp_ns : int
    reason : str
        Why there is no pose.
    T_odom_child : (4, 4) float64 or None
    restarted : bool
        Whether a new track began here.
    confidence : float
        Of the registration; NaN where there was none.
    seconds : float
    timings : dict of str to float
        Stage to seconds.
    track_id : int
        Poses of one number are in one frame; 0 where the cloud is unusable.
    """

    stamp_ns: int
    reason: str
    T_odom_child: NDArray[np.float64] | None = None
    restarted: bool = False
    confidence: float = math.nan
    seconds: float = math.nan
    timings: dict[str, float] = field(default_factory=dict)
    track_id: int = 0
