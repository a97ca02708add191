"""The paper's equations as plain dense numpy, slow and obvious: what the fast path must equal."""
import numpy as np


def pair_gaps(source, target):
    """Return d_ij for all pairs (Eq. 5), (N, N) metres."""
    p = np.linalg.norm(source[:, None] - source[None], axis=-1)
    q = np.linalg.norm(target[:, None] - target[None], axis=-1)
    return np.abs(p - q)


def geometric_consistency(gaps, sigma_d, cutoff):
    """Return M' (Eq. 6) and W_m (Eq. 8), both (N, N)."""
    consistent = (gaps**2 / sigma_d**2 - 1 <= 0).astype(float)
    weights = np.exp(-gaps**2 / (2 * sigma_d**2)) * (gaps <= cutoff * sigma_d)
    return consistent, weights


def semantic_consistency(source_labels, target_labels):
    """Return whether (s_i^p, s_j^p) equals (s_i^q, s_j^q) (Eq. 9 and 10), (N, N)."""
    n = len(source_labels)
    same = np.zeros((n, n), bool)
    for i in range(n):
        for j in range(n):
            same[i, j] = ((source_labels[i], source_labels[j])
                          == (target_labels[i], target_labels[j]))
    return same


def group_matrix(group, consistent, weights, tight, loose):
    """Return M* of one group (Eq. 7, 11 and 12), (k, k)."""
    local_to_global = consistent[group]                                   # M'_g, (k, w)
    global_aware = (consistent[np.ix_(group, group)]
                    * (local_to_global @ weights @ local_to_global.T))    # M*_g
    semantic = tight[np.ix_(group, group)] | loose[np.ix_(group, group)]  # M_s*
    return semantic * global_aware


def leading_eigenvector(matrix, rounds=10):
    """Return the vector of `rounds` power iterations from ones, (N,)."""
    vector = np.ones(len(matrix))
    for _ in range(rounds):
        vector = matrix @ vector
        vector /= np.linalg.norm(vector)
    return vector


def weighted_svd(source, target, weights):
    """Return T_target_source by weighted SVD (Eq. 14 and 15), (4, 4)."""
    w = weights / weights.sum()
    mean_p, mean_q = w @ source, w @ target
    u, _, vt = np.linalg.svd((source - mean_p).T @ np.diag(w) @ (target - mean_q))
    flip = np.diag([1, 1, np.linalg.det(vt.T @ u.T)])
    transform = np.eye(4)
    transform[:3, :3] = vt.T @ flip @ u.T
    transform[:3, 3] = mean_q - transform[:3, :3] @ mean_p
    return transform


def truncated_distance(transform, source, target, sigma_d):
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


def solve(source, target, sigma_d, cutoff, groups, group_size, keep, tau):
    """Return T_target_source from matches by the dense path, without labels and ground."""
    gaps = pair_gaps(source, target)
    consistent, weights = geometric_consistency(gaps, sigma_d, cutoff)
    everything = np.ones_like(consistent, bool)
    keys = np.argsort(-leading_eigenvector(weights * consistent), kind='stable')[:groups]
    kept, transforms = set(), []
    for key in keys:
        near = np.argsort(np.linalg.norm(source - source[key], axis=1), kind='stable')
        group = near[:group_size]
        row = group_matrix(group, consistent, weights, everything, everything)[
            list(group).index(key)]
        best = np.argsort(-row, kind='stable')[:keep]
        best = best[row[best] > 0]
        if len(best) >= 3:
            kept |= set(group[best])
            transforms.append(weighted_svd(source[group[best]], target[group[best]], row[best]))
    union = sorted(kept)
    costs = [truncated_distance(t, source[union], target[union], sigma_d) for t in transforms]
    best = transforms[int(np.argmin(costs))]
    moved = source @ best[:3, :3].T + best[:3, 3]
    near = np.linalg.norm(moved - target, axis=1) < tau
    return weighted_svd(source[near], target[near], np.ones(near.sum()))
