"""What a registration says in the light of the motion so far: which placement, or none."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.result import Placement
from ..core.result import Registration
from .config import TrackerConfig
from .covariance import square_root
from .motion import GATE
from .motion import Motion

Array = NDArray[np.float64]

UNKNOWN_COVARIANCE = np.diag([0.1**2] * 3 + [0.01**2] * 3)
"""Of a placement that comes without one, where it has to be compared with a prediction."""


@dataclass(frozen=True, eq=False)
class Step:
    """The motion from the reference to a scan that the tracker stands by.

    Attributes
    ----------
    T_reference_sensor : (4, 4) float64
    covariance : (6, 6) float64 or None
    systematic : (6, 6) float64 or None
        As of `Registration`.
    fused : Motion or None
        Where directions were predicted: pose and velocity with all that is known of them.
    note : str
        What was not as usual.
    """

    T_reference_sensor: Array
    covariance: Array | None
    systematic: Array | None = None
    fused: Motion | None = None
    note: str = ''


def choose(found: Registration, motion: Motion, stamp_ns: int, config: TrackerConfig
           ) -> Step | str:
    """Return the step that a registration and the motion so far agree on, or why there is none.

    A registration that stands for itself only has to be possible. Of several placements that
    the clouds cannot tell apart the motion must single one out, and along the directions that
    they leave open it is the motion that counts.

    Parameters
    ----------
    found : Registration
        To the reference.
    motion : Motion
        Of the last pose, relative to the same reference.
    stamp_ns : int
        Of the scan.
    config : TrackerConfig
    """
    if found.T_target_source is None:
        return found.reason
    if found.success:
        step = Step(found.T_target_source, found.covariance, found.systematic)
        return motion.impossible(stamp_ns, step.T_reference_sensor, config) or step
    if not len(found.degenerate) and not found.alternatives:
        return found.reason
    placements = (Placement(found.T_target_source, found.covariance, found.degenerate,
                            found.evidence), *found.alternatives)
    prediction = motion.predict(stamp_ns, config)
    fitting = [fit for placement in placements
               if (fit := _fit(placement, motion, prediction, config)) is not None]
    if len(fitting) == 1:
        return fitting[0]
    return (f'{found.reason}; {len(fitting) or "none"} of {len(placements)} '
            f'placement{"s" * (len(placements) > 1)} would fit the motion so far')


def _fit(placement: Placement, motion: Motion, prediction: Motion, config: TrackerConfig
         ) -> Step | None:
    """Return the step of a placement, if the motion so far leads there."""
    covariance = UNKNOWN_COVARIANCE if placement.covariance is None else placement.covariance
    information = _information(covariance, placement.degenerate)
    if prediction.distance(placement.T_target_source, information) > GATE:
        return None
    if not len(placement.degenerate):
        step = Step(placement.T_target_source, placement.covariance,
                    note='ambiguous: the motion so far chose among the placements')
    else:
        fused = prediction.fuse(placement.T_target_source, information)
        # what was predicted too far or too short goes on being so: nothing averages out
        step = Step(fused.T_reference_sensor, fused.pose_covariance,
                    square_root(fused.pose_covariance), fused,
                    f'degenerate: predicted along {_directions(placement.degenerate)}')
    possible = not motion.impossible(prediction.stamp_ns, step.T_reference_sensor, config)
    return step if possible else None


def _information(covariance: Array, degenerate: Array) -> Array:
    """Return the (6, 6) inverse of a covariance, with nothing known along (K, 6) directions."""
    information = np.linalg.inv(covariance)
    if len(degenerate):
        along = information @ degenerate.T
        information -= along @ np.linalg.solve(degenerate @ along, along.T)
    return (information + information.T) / 2


def _directions(degenerate: Array) -> str:
    """Name (K, 6) directions for a person."""
    return ' and '.join(
        f'({", ".join(f"{value:.2f}" for value in row[:3])})'
        if np.linalg.norm(row[:3]) >= np.linalg.norm(row[3:])
        else f'the turn about ({", ".join(f"{value:.2f}" for value in row[3:])})'
        for row in degenerate)
