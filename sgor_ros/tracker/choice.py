"""Which placement of a registration agrees with the predicted motion, if any (gating)."""
from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.config import SgorConfig
from ..core.icp.covariance import square_root
from ..core.icp.gicp import align
from ..core.prepared_scan import PreparedScan
from ..core.verdict.result import Placement
from ..core.verdict.result import Registration
from ..core.verdict.result import Status
from .config import TrackerConfig
from .motion import GATE
from .motion import Motion

Array = NDArray[np.float64]
Refine = Callable[[Placement], Placement]

LOOSE_M = 0.5
"""A placement less sure than this is corrected by the prediction too, names it directions or not.
"""
ROUGH_COVARIANCE = np.diag([0.5**2] * 3 + [0.03**2] * 3)
"""How far off a placement may be before it has been refined on the clouds."""
DEPENDENT = 1e-9
"""Directions below this share of the largest singular value are combinations of others."""
UNKNOWN_COVARIANCE = np.diag([0.1**2] * 3 + [0.01**2] * 3)
"""Of a placement that comes without one, where it has to be compared with a prediction."""


@dataclass(frozen=True, eq=False)
class Step:
    """The motion from the reference to a scan that the tracker stands by.

    Attributes
    ----------
    T_reference_sensor : (4, 4) float64
    covariance : (6, 6) float64 or None
    correlated_error : (6, 6) float64 or None
        As of `Registration`.
    fused : Motion or None
        Where directions were predicted: pose and velocity with all that is known of them.
    note : str
        What was not as usual.
    """

    T_reference_sensor: Array
    covariance: Array | None
    correlated_error: Array | None = None
    fused: Motion | None = None
    note: str = ''


def choose(found: Registration, motion: Motion, stamp_ns: int, config: TrackerConfig,
           refine: Refine) -> Step | str:
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
    refine : callable
        Refines a placement on the clouds: `Registration` has done so with its best one only.
    """
    if found.T_target_source is None or found.status is Status.REFUSED:
        return found.reason
    if found.status is Status.REGISTERED:
        step = Step(found.T_target_source, found.covariance, found.correlated_error)
        return motion.impossible(stamp_ns, step.T_reference_sensor, config) or step
    prediction = motion.predict(stamp_ns, config)
    best = Placement(found.T_target_source, found.covariance, _free(found))
    near = [refine(other) for other in found.alternatives
            if prediction.distance(other.T_target_source,
                                   _information(other, ROUGH_COVARIANCE)) < GATE]
    fitting = [fit for placement in (best, *near)
               if (fit := _fit(placement, motion, prediction, config)) is not None]
    if len(fitting) == 1:
        return fitting[0]
    count = 1 + len(found.alternatives)
    return (f'{found.reason}; {len(fitting) or "none"} of {count} '
            f'placement{"s" * (count > 1)} would fit the motion so far')


def relocalised(found: Registration, T_reference_keyframe: Array | None, motion: Motion,
                stamp_ns: int, config: TrackerConfig) -> Step | str:
    """Return the step to a keyframe that is not the reference, or why there is none.

    Parameters
    ----------
    found : Registration
        To that keyframe; it has to stand for itself.
    T_reference_keyframe : (4, 4) float64 or None
        Where the keyframe is; None where it is of another track, which no motion leads to.
    motion : Motion
        Of the last pose, relative to the reference.
    stamp_ns : int
        Of the scan.
    config : TrackerConfig
    """
    if found.status is not Status.REGISTERED or found.T_target_source is None:
        return found.reason
    step = Step(found.T_target_source, found.covariance, found.correlated_error)
    if T_reference_keyframe is None:
        return step
    return motion.impossible(stamp_ns, T_reference_keyframe @ found.T_target_source,
                             config) or step


def is_likely(found: Registration, prediction: Motion) -> bool:
    """Whether a registration that stands for itself lies where it was predicted."""
    assert found.T_target_source is not None
    return prediction.distance(found.T_target_source, _information(Placement(
        found.T_target_source, found.covariance, found.degenerate))) < GATE


def _free(found: Registration) -> Array:
    """Return (K, 6) degenerate directions of the best placement; the alternatives share them.

    Its wide covariance alone would be taken for a weak measurement, scan after scan.
    """
    if len(found.degenerate) or not found.alternatives:
        return found.degenerate
    return found.alternatives[0].degenerate


def _fit(placement: Placement, motion: Motion, prediction: Motion, config: TrackerConfig
         ) -> Step | None:
    """Return the step of a placement, if the motion so far leads there."""
    information = _information(placement)
    if prediction.distance(placement.T_target_source, information) > GATE:
        return None
    if not _is_loose(placement):
        step = Step(placement.T_target_source, placement.covariance,
                    note='ambiguous: the motion so far chose among the placements')
    else:
        fused = prediction.fuse(placement.T_target_source, information)
        # what was predicted too far or too short goes on being so: nothing averages out
        step = Step(fused.T_reference_sensor, fused.pose_covariance,
                    square_root(fused.pose_covariance), fused,
                    f'degenerate: predicted{_along(placement.degenerate)}')
    possible = not motion.impossible(prediction.stamp_ns, step.T_reference_sensor, config)
    return step if possible else None


def refined(placement: Placement, source: PreparedScan, target: PreparedScan,
            config: SgorConfig) -> Placement:
    """Return a placement refined on the clouds; what is unknown of it stays unknown."""
    if source.surface is None or target.surface is None:
        return placement
    local = align(source.surface, target.surface, placement.T_target_source,
                  config.scaled(max(source.scale, target.scale)))
    return replace(placement, T_target_source=local.T_target_source, covariance=(
        placement.covariance if _is_loose(placement) else local.covariance))


def _is_loose(placement: Placement) -> bool:
    """Whether a placement leaves open where the scan is, by direction or by covariance."""
    return bool(len(placement.degenerate)) or (
        placement.covariance is not None
        and float(np.trace(placement.covariance[:3, :3])) > LOOSE_M**2)


def _information(placement: Placement, besides: Array | float = 0.0) -> Array:
    """Return the (6, 6) information of a placement: nothing along its free directions.

    `besides` is added to its covariance. Never negative, whatever the directions are: they are
    projected out of a square root of the information.
    """
    covariance = or_unknown(placement.covariance)
    root = np.linalg.inv(np.linalg.cholesky(covariance + besides))    # root^T root: information
    if len(placement.degenerate):
        free = root @ placement.degenerate.T
        # lengths cancel, so directions in metres and radians weigh alike
        spanning, sizes, _ = np.linalg.svd(free / np.linalg.norm(free, axis=0),
                                           full_matrices=False)
        spanning = spanning[:, sizes > DEPENDENT * sizes[0]]
        root = root - spanning @ (spanning.T @ root)
    return np.asarray(root.T @ root)


def _along(degenerate: Array) -> str:
    """Name (K, 6) directions for a person."""
    return ' along ' * bool(len(degenerate)) + ' and '.join(
        f'({", ".join(f"{value:.2f}" for value in row[:3])})'
        if np.linalg.norm(row[:3]) >= np.linalg.norm(row[3:])
        else f'the turn about ({", ".join(f"{value:.2f}" for value in row[3:])})'
        for row in degenerate)


def or_unknown(covariance: Array | None) -> Array:
    """Return a (6, 6) covariance, or what to take where there is none."""
    return UNKNOWN_COVARIANCE if covariance is None else covariance
