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
from ..scan.context import OCTAVES
from ..scan.descriptors import regional_labels
from ..scan.features import Features
from ..scan.labels import label_convention
from ..scan.labels import LabelConvention
from ..scan.labels import UNLABELLED
from ..scan.neighbours import radius_neighbours
from ..scan.voxels import one_point_voxels


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
    """Keep the classes that both scans have (Eq. 4); unlabelled points stay."""
    shared = (np.bincount(source.labels, minlength=256) > 0)
    shared &= (np.bincount(target.labels, minlength=256) > 0)
    shared[UNLABELLED] = True
    p, q = shared[source.labels], shared[target.labels]
    return source if p.all() else source[p], target if q.all() else target[q]


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
    source = source[thin(len(source.points), config.max_correspondences)]
    if source.heights is None or target.heights is None:
        source_heights, target_heights = np.zeros(len(source.points)), np.zeros(len(target.points))
    else:
        source_heights, target_heights = source.heights, target.heights
    gate = config.height_gate if config.height_gate > 0 else np.inf
    within = config.match_within_labels and config.semantics != 'none'
    block = target.regional if within else np.zeros_like(target.regional)
    wanted = source.regional if within else np.zeros_like(source.regional)
    # sorted by label, then height, the candidates of a point stand in one run
    order = np.lexsort((target_heights, block))
    sorted_block, sorted_heights = block[order], target_heights[order]
    described, candidates = _joint_descriptors(source, target, config)
    first, last = np.zeros(len(source.points), np.int64), np.zeros(len(source.points), np.int64)
    for label in np.unique(wanted):
        low, high = np.searchsorted(sorted_block, [label, int(label) + 1])
        rows = wanted == label
        run = sorted_heights[low:high]
        first[rows] = low + np.searchsorted(run, source_heights[rows] - gate)
        last[rows] = low + np.searchsorted(run, source_heights[rows] + gate, side='right')
    nearest = _nearest_in_runs(described, candidates[order], first, last)
    found = np.flatnonzero(nearest >= 0)
    s, t = source[found], target[order[nearest[found]]]
    return Correspondences(s.points, t.points, s.labels, t.labels, s.regional, t.regional)


def thin(count: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` of the indices 0 to count - 1, evenly spread."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.intp)


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


@numba.njit(cache=True, nogil=True, parallel=True, fastmath=True)
def _nearest_in_runs(source, target, first, last):  # type: ignore[no-untyped-def]
    """Return for each source row the nearest target row of its run, -1 for an empty run."""
    nearest = np.empty(len(source), np.int64)
    for i in numba.prange(len(source)):
        best = np.float32(np.inf)
        at = -1
        for j in range(first[i], last[i]):
            distance = np.float32(0.0)
            for d in range(source.shape[1]):
                gap = source[i, d] - target[j, d]
                distance += gap * gap
            if distance < best:
                best = distance
                at = j
        nearest[i] = at
    return nearest
