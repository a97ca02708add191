"""How far off a refined transformation may be: noise of the pairs, and errors that repeat.

The figures are measured, on streets, in scenes of other kinds and on KITTI: docs/method.md.
"""
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CORRELATED_PAIRS = 8
"""So many pairs of points err as one: the pattern of the beams and the grid leave less to average
than there are pairs."""
CORRELATED_PARTS = 2.0
"""So many parts of the scan err as one: a surface may reach through several."""
PARTS_REPEAT = 0.25
"""This share of what the parts tell errs alike in step after step: the same trunks are seen from
nearly the same side."""
ALONG = 0.02
"""The grid and the rings of the beams move with the sensor and pull a motion towards what they
repeat at. Standard deviation along the motion, in edges of the grid."""
ACROSS = 0.002
"""The same across the motion."""
TURN = 0.018
"""The same of a point at the middle range when the scan is tilted or turned."""
LEAST_MEAN_SQUARE = 0.01
"""Of the Mahalanobis distances: a scan that is sent twice fits without noise, which says nothing
of the motion. Scans of their own leave 0.05 to 0.12."""


def noise(information: Array, error: float, pairs: int) -> Array | None:
    """Return the (6, 6) covariance that GICP's pairs leave, in the target frame.

    Parameters
    ----------
    information : (6, 6) float64
        Of (x, y, z, rotation about x, y, z) in the target frame.
    error : float
        Half the sum of the squared Mahalanobis distances.
    pairs : int

    Returns
    -------
    (6, 6) float64 or None
        Of (x, y, z, rotation about x, y, z); None where a direction is not observed at all.
    """
    if pairs <= 6 or np.linalg.cond(information) > 1e12:
        return None
    # the errors are Mahalanobis: their mean square scales the inverse Hessian
    mean_square = max(2.0 * error / (3 * pairs - 6), LEAST_MEAN_SQUARE)
    covariance: Array = np.linalg.inv(information) * mean_square * CORRELATED_PAIRS
    return (covariance + covariance.T) / 2


def between_parts(information: Array, gradients: Array) -> Array:
    """Return the (6, 6) covariance that the parts of a scan show by not agreeing (sandwich).

    Pairs of one part err alike: they lie on the same trunk, on the same ring of the beams, are of
    the same car that drives. What each part pulls by, beyond what balances the others, tells how
    much, whatever the reason is: the cluster-robust estimator of a least squares fit.

    Parameters
    ----------
    information : (6, 6) float64
    gradients : (B, 6) float64
        Of the error, a row a part; their sum is about zero.
    """
    inverse = np.linalg.inv(information)
    spread: Array = inverse @ (gradients.T @ gradients) @ inverse
    return CORRELATED_PARTS * (spread + spread.T) / 2


def correlated_part(root: Array, parts: Array) -> Array:
    """Return the square root of all that errs alike in step after step.

    Parameters
    ----------
    root : (6, 6) float64
        Of `correlated_error`.
    parts : (6, 6) float64
        Covariance `between_parts`.
    """
    return square_root(root @ root.T + PARTS_REPEAT * parts)


def square_root(covariance: Array) -> Array:
    """Return the symmetric square root of a (6, 6) covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def correlated_error(T_target_source: Array, middle_range: float, edge: float) -> Array:
    """Return the square root S of the covariance S S^T of what errs alike in step after step.

    It grows with the motion up to one edge of the grid, and from there on stays as it is.

    Parameters
    ----------
    T_target_source : (4, 4) float64
    middle_range : float
        Median distance of the source's points from the sensor, metres.
    edge : float
        Edge of the voxel grid, metres.

    Returns
    -------
    (6, 6) float64
        In the target frame, metres and radians.
    """
    R, t = T_target_source[:3, :3], T_target_source[:3, 3]
    metres = float(np.linalg.norm(t))
    turned = float(np.arccos(np.clip((np.trace(R) - 1) / 2, -1.0, 1.0))) * middle_range
    size = min(edge, metres + turned)
    root = np.diag([ACROSS * size] * 3 + [TURN * size / middle_range] * 3)
    if metres > 0:
        root[:3, :3] += (ALONG - ACROSS) * size * np.outer(t, t) / metres**2
    return root
