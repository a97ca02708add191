"""Two-stage hypothesis verification (Sec. III-D): ground normals, then truncated distance."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from ..config import SgorConfig
from ..execution.threads import parallel_for
from ..index.scan_index import ScanIndex
from ..matching.correspondences import Correspondences
from ..scoring.pose_scoring import rough_scores
from .hypotheses import Hypotheses

Normals = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Ground normals of source and target, unit (3,) vectors towards their sensors."""


@dataclass(frozen=True, eq=False)
class Verification:
    """Which hypotheses passed.

    Attributes
    ----------
    passed_ground_check : (H,) bool
    cost : (H,) float64
        Mean truncated distance over G', metres; infinite where the ground check failed.
    score : (H,) float64
        What chose: minus the cost, or the evidence of the clouds.
    best : int
        Index of the winner, -1 if none passed.
    """

    passed_ground_check: NDArray[np.bool_]
    cost: NDArray[np.float64]
    score: NDArray[np.float64]
    best: int

    @property
    def reason(self) -> str:
        """Why there is no winner, in words; empty where there is one."""
        if self.best >= 0:
            return ''
        if not len(self.cost):
            return 'no group of correspondences is consistent'
        return f'none of {len(self.cost)} hypotheses keeps the ground level'


def verify(hypotheses: Hypotheses, correspondences: Correspondences,
           ground_normals: Normals | None, indexes: tuple[ScanIndex, ScanIndex] | None,
           config: SgorConfig) -> Verification:
    """Drop hypotheses that tilt the ground, then take the nearest fit of the filtered matches.

    With the indexes of source and target and `cloud_check`, the clouds choose instead of the fit.
    """
    T = hypotheses.T_target_source
    passed = np.ones(len(T), np.bool_)
    if config.ground_check and ground_normals is not None:
        passed = ground_angles(T, *ground_normals) < config.sigma_theta
    cost = np.full(len(T), np.inf)
    if not passed.any():
        return Verification(passed, cost, -cost, -1)
    cost[passed] = truncated_distance(
        T[passed], correspondences.source[hypotheses.union],
        correspondences.target[hypotheses.union], config.sigma_d)
    score = -cost
    if config.cloud_check and indexes is not None:
        score[passed] = rough_scores(*indexes, T[passed])
    return Verification(passed, cost, score, int(np.argmax(score)))


def ground_angles(T: NDArray[np.float64], source_normal: NDArray[np.float64],
                  target_normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angle between R n_p and n_q for each of (H, 4, 4), radians (Eq. 17).

    Both normals point to their sensor, so the sign counts: an upside-down ground is refused.
    """
    moved = T[:, :3, :3] @ source_normal
    return np.arctan2(np.linalg.norm(np.cross(moved, target_normal), axis=1),
                      moved @ target_normal)


def truncated_distance(T: NDArray[np.float64], source: NDArray[np.float64],
                       target: NDArray[np.float64], sigma_d: float) -> NDArray[np.float64]:
    """Return the mean of TD over (N, 3) matches for each of (H, 4, 4) (Eq. 18 and 19), metres."""
    cost = np.empty(len(T))
    parallel_for(_truncated_distance, len(T), T, np.ascontiguousarray(source.T),
                 np.ascontiguousarray(target.T), sigma_d, cost)
    return cost


def near_counts(T: NDArray[np.float64], source: NDArray[np.float64], target: NDArray[np.float64],
                reach: float) -> NDArray[np.int64]:
    """Return how many of (N, 3) matches lie within `reach` metres for each of (H, 4, 4)."""
    counts = np.zeros(len(T), np.int64)
    parallel_for(_near_counts, len(T), T, np.ascontiguousarray(source.T),
                 np.ascontiguousarray(target.T), reach, counts)
    return counts


@numba.njit(cache=True, nogil=True, fastmath=True)
def _squared_distances(T, source, target, squared):
    """Write how far each match lies apart, squared; (3, N) columns, so that there are vectors."""
    # all out of the loop: what is written might be a part of it
    (a, b, c, x0), (d, e, f, y0), (g, h, k, z0) = T[0], T[1], T[2]
    px, py, pz = source[0], source[1], source[2]
    qx, qy, qz = target[0], target[1], target[2]
    for i in range(len(squared)):
        x = a * px[i] + b * py[i] + c * pz[i] + x0 - qx[i]
        y = d * px[i] + e * py[i] + f * pz[i] + y0 - qy[i]
        z = g * px[i] + h * py[i] + k * pz[i] + z0 - qz[i]
        squared[i] = x * x + y * y + z * z


@numba.njit(cache=True, nogil=True, fastmath=True)
def _truncated_distance(first, last, T, source, target, sigma_d,
                        cost):
    squared = np.empty(source.shape[1])
    for h in range(first, last):
        _squared_distances(T[h], source, target, squared)
        total = 0.0
        for i in range(len(squared)):
            total += min(max(np.sqrt(squared[i]), 0.5 * sigma_d), 2.5 * sigma_d)
        cost[h] = total / len(squared)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _near_counts(first, last, T, source, target, reach, counts):
    squared = np.empty(source.shape[1])
    for h in range(first, last):
        _squared_distances(T[h], source, target, squared)
        near = 0
        for i in range(len(squared)):
            near += squared[i] < reach * reach
        counts[h] = near
