"""The paper's equations as plain dense numpy, slow and obvious: what the fast path must equal."""
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

Array = NDArray[Any]


def pair_gaps(source: Array, target: Array) -> Array:
    """Return d_ij for all pairs (Eq. 5), (N, N) metres."""
    p = np.linalg.norm(source[:, None] - source[None], axis=-1)
    q = np.linalg.norm(target[:, None] - target[None], axis=-1)
    return np.asarray(np.abs(p - q))


def geometric_consistency(gaps: Array, sigma_d: float, cutoff: float) -> tuple[Array, Array]:
    """Return M' (Eq. 6) and W_m (Eq. 8), both (N, N)."""
    consistent = (gaps**2 / sigma_d**2 - 1 <= 0).astype(float)
    weights = np.exp(-gaps**2 / (2 * sigma_d**2)) * (gaps <= cutoff * sigma_d)
    return consistent, weights


def semantic_consistency(source_labels: ArrayLike, target_labels: ArrayLike) -> NDArray[np.bool_]:
    """Return whether (s_i^p, s_j^p) equals (s_i^q, s_j^q) (Eq. 9 and 10), (N, N)."""
    p, q = np.asarray(source_labels), np.asarray(target_labels)
    return np.asarray((p[:, None] == q[:, None]) & (p[None] == q[None]))


def group_matrix(group: NDArray[np.intp], consistent: Array, weights: Array,
                 tight: NDArray[np.bool_], loose: NDArray[np.bool_]) -> Array:
    """Return M* of one group (Eq. 7, 11 and 12), (k, k)."""
    local_to_global = consistent[group]                                   # M'_g, (k, w)
    global_aware = (consistent[np.ix_(group, group)]
                    * (local_to_global @ weights @ local_to_global.T))    # M*_g
    semantic = tight[np.ix_(group, group)] | loose[np.ix_(group, group)]  # M_s*
    return np.asarray(semantic * global_aware)


def leading_eigenvector(matrix: Array, rounds: int = 10) -> Array:
    """Return the vector of `rounds` power iterations from ones, (N,)."""
    vector = np.ones(len(matrix))
    for _ in range(rounds):
        vector = matrix @ vector
        vector /= np.linalg.norm(vector)
    return vector


def weighted_svd(source: Array, target: Array, weights: Array) -> Array:
    """Return T_target_source by weighted SVD (Eq. 14 and 15), (4, 4)."""
    w = weights / weights.sum()
    mean_p, mean_q = w @ source, w @ target
    u, _, vt = np.linalg.svd((source - mean_p).T @ np.diag(w) @ (target - mean_q))
    flip = np.diag([1, 1, np.linalg.det(vt.T @ u.T)])
    transform = np.eye(4)
    transform[:3, :3] = vt.T @ flip @ u.T
    transform[:3, 3] = mean_q - transform[:3, :3] @ mean_p
    return transform


def truncated_distance(transform: Array, source: Array, target: Array, sigma_d: float) -> float:
    """Return the mean TD (Eq. 18 and 19), metres."""
    total = 0.0
    for p, q in zip(source, target, strict=True):
        distance = np.linalg.norm(transform[:3, :3] @ p + transform[:3, 3] - q)
        if distance <= 0.5 * sigma_d:
            total += 0.5 * sigma_d
        elif distance < 2.5 * sigma_d:
            total += distance
        else:
            total += 2.5 * sigma_d
    return total / len(source)


def ground_angle(transform: Array, source_normal: Array, target_normal: Array) -> float:
    """Return the angle between R n_p and n_q, radians (Eq. 17)."""
    return float(np.arccos(np.clip((transform[:3, :3] @ source_normal) @ target_normal, -1, 1)))


def refine(transform: Array, source: Array, target: Array, tau: float) -> Array:
    """Return the SVD of all matches nearer than tau (Eq. 20), or the transform if under three."""
    moved = source @ transform[:3, :3].T + transform[:3, 3]
    near = np.linalg.norm(moved - target, axis=1) < tau
    if near.sum() < 3:
        return transform
    return weighted_svd(source[near], target[near], np.ones(near.sum()))


def spread(points: Array, order: NDArray[np.intp], count: int, spacing: float) -> list[int]:
    """Return the strongest keys at least `spacing` apart, then the strongest of the others."""
    taken: list[int] = []
    passed: list[int] = []
    for i in order:
        near = any(np.linalg.norm(points[i] - points[t]) < spacing for t in taken)
        (passed if near else taken).append(i)
        if len(taken) == count:
            break
    return (taken + passed)[:count]


def solve(source: Array, target: Array, sigma_d: float, cutoff: float, groups: int,
          group_size: int, keep: int, tau: float, spacing: float = 0.0, labels: Any = None,
          regional: Any = None, normals: Any = None, sigma_theta: float = np.pi) -> Array | None:
    """Return T_target_source from matches by the dense path, None where no hypothesis passes.

    Labels are pairs: of the source, of the target; without them geometry alone counts.
    """
    gaps = pair_gaps(source, target)
    consistent, weights = geometric_consistency(gaps, sigma_d, cutoff)
    everything = np.ones_like(consistent, bool)
    tight = everything if labels is None else semantic_consistency(*labels)
    loose = everything if regional is None else semantic_consistency(*regional)
    order = np.argsort(-leading_eigenvector(weights * consistent), kind='stable')
    kept, transforms = set(), []
    for key in spread(source, order, groups, spacing):
        near = np.argsort(np.linalg.norm(source - source[key], axis=1), kind='stable')
        group = near[:group_size]
        row = group_matrix(group, consistent, weights, tight, loose)[list(group).index(key)]
        best = np.argsort(-row, kind='stable')[:keep]
        best = best[row[best] > 0]
        kept |= set(group[best])
        if len(best) >= 3:
            transforms.append(weighted_svd(source[group[best]], target[group[best]], row[best]))
    if normals is not None:
        transforms = [t for t in transforms if ground_angle(t, *normals) < sigma_theta]
    if not transforms:
        return None
    union = sorted(kept)
    costs = [truncated_distance(t, source[union], target[union], sigma_d) for t in transforms]
    return refine(transforms[int(np.argmin(costs))], source, target, tau)


def fit_plane(points: Array) -> tuple[Array, float]:
    """Return (a, b, c) and d of the plane of points, the normal towards the origin (Eq. 16)."""
    mu = points.mean(axis=0)
    scatter = sum(np.outer(p - mu, p - mu) for p in points)
    normal = np.linalg.svd(scatter)[2][-1]
    d = -normal @ mu
    return (normal, d) if d >= 0 else (-normal, -d)


def plane_distance(plane: tuple[Array, float], points: Array) -> Array:
    """Return the left side of Eq. 3, the root of a^2 + b^2 + c^2 below the line, (N,) metres."""
    normal, d = plane
    return np.abs(points @ normal + d) / np.sqrt(normal @ normal)


def ground(points: Array, labels: Array, ground_labels: Any, sigma_g: float, narrow: bool,
           others: Array, other_labels: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the ground normal of labelled points, and which of other points are ground.

    Eq. 2, SVD, Eq. 3, SVD; narrow: new ground points are among those of Eq. 2.
    """
    first = fit_plane(points[np.isin(labels, ground_labels)])
    near, others_near = (plane_distance(first, p) < sigma_g for p in (points, others))
    if narrow:
        near &= np.isin(labels, ground_labels)
        others_near &= np.isin(other_labels, ground_labels)
    return fit_plane(points[near])[0], others_near


def overlap(source_labels: Any, target_labels: Any, ground_labels: Any
            ) -> list[NDArray[np.bool_]]:
    """Return which points have a label of both scans that is not of the ground (Eq. 4)."""
    common = (set(source_labels) & set(target_labels)) - set(ground_labels)
    return [np.array([s in common for s in labels]) for labels in (source_labels, target_labels)]


def regional_labels(points: Array, votes: NDArray[Any], radius: float) -> NDArray[Any]:
    """Return the label with most votes within a radius; points have a vote a label, (N, C)."""
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return np.array([votes[row <= radius].sum(axis=0).argmax() for row in distance])


def voxels(points: Array, labels: NDArray[Any], size: float) -> tuple[Array, NDArray[Any]]:
    """Return mean points and votes (V, 256) of all cells, in order of their first points."""
    cells: dict[Any, Any] = {}
    for cell, point, label in zip(map(tuple, np.floor(points / size)), points, labels,
                                  strict=True):
        cells.setdefault(cell, []).append((point, label))
    means = np.array([np.mean([p for p, _ in cell], axis=0) for cell in cells.values()])
    votes = np.array([np.bincount([s for _, s in cell], minlength=256)
                      for cell in cells.values()])
    return means, votes


def nearest(source: Array, target: Array) -> NDArray[Any]:
    """Return for each descriptor of the source the nearest of the target, (N,)."""
    return np.array([np.linalg.norm(target - row, axis=1).argmin() for row in source])
