"""Semantic overlap region and feature matching (Sec. III-B, Eq. 4)."""
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from ..common.checks import as_labels
from ..common.checks import finite_points
from ..common.settings import InputError
from ..config import SgorConfig
from ..execution.threads import parallel_for
from ..features.descriptors import regional_labels
from ..features.features import Features
from ..features.neighbours import radius_neighbours
from ..features.semantic_context import OCTAVES
from ..scan.labels import label_convention
from ..scan.labels import LabelConvention
from ..scan.labels import UNLABELLED
from ..scan.voxels import one_point_voxels
from ..scan.voxels import thin

MOST_COMPARISONS = 150_000_000
"""Pairs of descriptors, some tenths of a second; beyond it fewer source keypoints are matched."""


@dataclass(frozen=True, eq=False)
class Correspondences:
    """G: row i of `source` is held to be the same place as row i of `target`.

    Attributes
    ----------
    source, target : (N, 3) float64
        Metres, each in its own scan's frame.
    source_labels, target_labels : (N,) uint8
        Single-point labels s^p and s^q.
    source_regional, target_regional : (N,) uint8
        Regional votes S(p) and S(q).
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    source_labels: NDArray[np.uint8]
    target_labels: NDArray[np.uint8]
    source_regional: NDArray[np.uint8]
    target_regional: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.source)


def given_correspondences(source_points: ArrayLike, target_points: ArrayLike,
                          source_labels: ArrayLike | None, target_labels: ArrayLike | None,
                          config: SgorConfig) -> Correspondences:
    """Check matches from elsewhere and vote their regional labels among their own points.

    Raises
    ------
    InputError
        Shapes that do not fit, values that are not finite, labels of one side only.
    """
    p = finite_points(source_points, 'source_points')
    q = finite_points(target_points, 'target_points')
    if len(p) != len(q):
        raise InputError(f'target_points: expected one a source point, {len(p)}, got {len(q)}')
    if (source_labels is None) != (target_labels is None):
        raise InputError('source_labels and target_labels: give both or none')
    if source_labels is None or target_labels is None:
        none = np.full(len(p), UNLABELLED, np.uint8)
        return Correspondences(p, q, none, none, none, none)
    convention = label_convention(config.label_convention)
    s_ids = as_labels(source_labels, len(p), 'source_labels')
    t_ids = as_labels(target_labels, len(p), 'target_labels')
    s, s_regional = _voted(p, s_ids, convention, config)
    t, t_regional = _voted(q, t_ids, convention, config)
    return Correspondences(p, q, s, t, s_regional, t_regional)


def overlap_region(source: Features, target: Features) -> tuple[Features, Features]:
    """Keep the classes that both scans have (Eq. 4); unlabelled points stay.

    A class that one scan lacks stays too where its points may be hidden among the unlabelled.
    """
    p_count, q_count = (np.bincount(f.labels, minlength=256) for f in (source, target))
    p = ((q_count > 0) | (p_count <= q_count[UNLABELLED]))[source.labels]
    q = ((p_count > 0) | (q_count <= p_count[UNLABELLED]))[target.labels]
    p |= source.labels == UNLABELLED
    q |= target.labels == UNLABELLED
    return source if p.all() else source[p], target if q.all() else target[q]


def sampled(source: Features, target: Features, config: SgorConfig) -> tuple[Features, Features]:
    """Draw `max_correspondences` keypoints of each, without replacement; the order stays."""
    rng = np.random.default_rng(config.sampling_seed)
    p, q = (np.sort(rng.permutation(len(each.points))[:config.max_correspondences])
            for each in (source, target))
    return source[p], target[q]


def match(source: Features, target: Features, config: SgorConfig) -> Correspondences:
    """Find for each source keypoint the target keypoint with the nearest descriptor.

    One way, several to one allowed. `match_within_labels` and, where both scans have a ground
    plane, `height_gate` narrow the search, and the semantic context joins the descriptor.

    Raises
    ------
    InputError
        Descriptors of different lengths.
    """
    if source.descriptors.shape[1] != target.descriptors.shape[1]:
        raise InputError(f'descriptors: source has {source.descriptors.shape[1]} columns, target '
                         f'{target.descriptors.shape[1]}')
    if config.sampled_keypoints:
        source, target = sampled(source, target, config)
    source = source[thin(len(source.points), config.max_correspondences)]
    within = config.match_within_labels and config.semantics != 'none'
    described, candidates = _joint_descriptors(source, target, config)
    nearest = np.full(len(source.points), -1, np.int64)
    # what has no label matches everything, and everything what has none
    free = (source.regional == UNLABELLED) if within else np.ones(len(nearest), np.bool_)
    for rows, by_label in ((np.flatnonzero(free), False), (np.flatnonzero(~free), True)):
        if rows.size:
            order, first, last = _runs(source[rows], target, by_label, config)
            asked = thin(len(rows), _affordable(first, last))
            rows, first, last = rows[asked], first[asked], last[asked]
            found = np.empty(len(rows), np.int64)
            parallel_for(_nearest_in_runs, len(rows), described[rows], candidates[order], first,
                         last, found)
            nearest[rows[found >= 0]] = order[found[found >= 0]]
    found = np.flatnonzero(nearest >= 0)
    s, t = source[found], target[nearest[found]]
    return Correspondences(s.points, t.points, s.labels, t.labels, s.regional, t.regional)


def _affordable(first: NDArray[np.int64], last: NDArray[np.int64]) -> int:
    """Return how many of (N, R) runs can be searched, taken evenly, by `MOST_COMPARISONS`."""
    comparisons = int((last - first).sum())
    return len(first) * MOST_COMPARISONS // max(comparisons, MOST_COMPARISONS)


def _runs(source: Features, target: Features, by_label: bool, config: SgorConfig
          ) -> tuple[NDArray[np.intp], NDArray[np.int64], NDArray[np.int64]]:
    """Return the target in an order in which the candidates of a source point stand in runs.

    Returns
    -------
    order : (V,) int
        Sorted by label, if it counts, then height.
    first, last : (N, R) int64
        Runs of each source point in that order, one of its label and one without a label.
    """
    if source.heights is None or target.heights is None:
        heights, target_heights = np.zeros(len(source.points)), np.zeros(len(target.points))
    else:
        heights, target_heights = source.heights, target.heights
    gate = config.height_gate if config.height_gate > 0 else np.inf
    block = target.regional if by_label else np.zeros_like(target.regional)
    wanted = source.regional if by_label else np.zeros_like(source.regional)
    order = np.lexsort((target_heights, block))
    sorted_block, sorted_heights = block[order], target_heights[order]
    first = np.zeros((len(wanted), 2 if by_label else 1), np.int64)
    last = np.zeros_like(first)
    for label in np.unique(wanted):
        rows = np.flatnonzero(wanted == label)
        for run, of in enumerate((label, UNLABELLED)[:first.shape[1]]):
            low, high = np.searchsorted(sorted_block, [of, int(of) + 1])
            sorted_run = sorted_heights[low:high]
            first[rows, run] = low + np.searchsorted(sorted_run, heights[rows] - gate)
            last[rows, run] = low + np.searchsorted(sorted_run, heights[rows] + gate, side='right')
    return order, first, last


def _joint_descriptors(source: Features, target: Features, config: SgorConfig
                       ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Append the weighted context columns that are not empty, where both scans have any."""
    p, q = source.context, target.context
    if p is None or q is None or p.shape[1] != q.shape[1]:
        return source.descriptors, target.descriptors
    used = p.any(axis=0) & q.any(axis=0)
    by_class = np.arange(used.size) >= OCTAVES
    used &= ~by_class if config.semantics == 'none' else by_class
    weight = np.float32(config.context_weight)
    return (np.hstack((source.descriptors, weight * p[:, used])),
            np.hstack((target.descriptors, weight * q[:, used])))


def _voted(points: NDArray[np.float64], ids: NDArray[np.int64], convention: LabelConvention,
           config: SgorConfig) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return point labels and regional labels of matches, (N,) each."""
    labels, _, _ = convention.decode(ids)
    cloud = one_point_voxels(points, labels)
    neighbours = radius_neighbours(points, config.vote_radius)
    return labels, regional_labels(cloud, neighbours, config.vote_radius)


@numba.njit(cache=True, nogil=True, fastmath=True)
def _nearest_in_runs(begin, end, source, target, first, last,
                     nearest):
    """Write for each source row the nearest target row of its runs, -1 for empty ones."""
    for i in range(np.uint64(begin), np.uint64(end)):
        best = np.float32(np.inf)
        at = -1
        for run in range(first.shape[1]):
            for j in range(first[i, run], last[i, run]):
                distance = np.float32(0.0)
                for d in range(source.shape[1]):
                    gap = source[i, d] - target[j, d]
                    distance += gap * gap
                if distance < best:
                    best = distance
                    at = j
        nearest[i] = at
