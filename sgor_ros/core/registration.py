"""SGOR on one screen: `register` two scans, `solve` for the transformation of matches."""
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from .alignment import align
from .alignment import Alignment
from .common.stopwatch import Stopwatch
from .common.tasks import at_once
from .common.threads import cores
from .config import SgorConfig
from .matching.correspondences import Correspondences
from .matching.correspondences import given_correspondences
from .matching.correspondences import match
from .matching.correspondences import overlap_region
from .result import Registration
from .scan.preprocessing import at_scale
from .scan.preprocessing import preprocess
from .scan.scan import as_scan
from .scan.scan import PreparedScan
from .scan.scan import SemanticScan
from .solver.consistency import filter_groups
from .solver.graph import consistency_graph
from .solver.grouping import group
from .solver.hypotheses import hypothesise
from .solver.hypotheses import MIN_POINTS
from .solver.refinement import distances
from .solver.refinement import refine
from .solver.refinement import unobservable
from .solver.verification import Normals
from .solver.verification import verify
from .trust.acceptance import compete
from .trust.acceptance import judge_matches
from .trust.acceptance import settle
from .trust.hints import frame_hint
from .trust.hints import scale_hint
from .trust.rivals import Contest
from .trust.view import View


def register(source: SemanticScan | PreparedScan | ArrayLike,
             target: SemanticScan | PreparedScan | ArrayLike,
             config: SgorConfig | None = None) -> Registration:
    """Find the transformation between two overlapping scans, without an initial guess.

    Parameters
    ----------
    source, target : SemanticScan, PreparedScan or (N, 3) array
        Prepared scans are used as they are: prepare once, register often. Arrays are points
        without labels, metres.
    config : SgorConfig, optional
        ``SgorConfig()`` where none is given.

    Returns
    -------
    Registration
        With ``success=False`` and a reason where the scans cannot be registered.

    Raises
    ------
    InputError
        What is no scan, or no configuration.
    """
    config = SgorConfig.given(config)
    scans = as_scan(source, 'source'), as_scan(target, 'target')
    with cores(config.threads):
        return _register(*scans, config)


def _register(one: SemanticScan | PreparedScan, other: SemanticScan | PreparedScan,
              config: SgorConfig) -> Registration:
    clock = Stopwatch()
    with clock('preprocessing'):
        source, target = at_once(config.threads, partial(_prepared, one, config),
                                 partial(_prepared, other, config))
        if source.scale != target.scale:    # the coarser one costs less and sees farther
            source, target = (at_scale(scan, max(source.scale, target.scale))
                              for scan in (source, target))
    config = config.scaled(source.scale)
    labelled = all(scan.features.labelled_share > 0 for scan in (source, target))
    doubtful = source.scale < 1 and any(
        scan.ground is None or scan.ground.source == 'geometry' for scan in (source, target))
    for attempt in _attempts(config, labelled=labelled, level=not doubtful):
        result, contest = _globally(source, target, attempt, clock)
        if result.success:
            break
    if result.success and contest is not None:
        result = _locally(result, contest, source, target, config, clock)
    result = with_grounds(result, source, target)
    return replace(result, warnings=(*result.warnings, *_hints(result, source, target, config)))


def _prepared(scan: SemanticScan | PreparedScan, config: SgorConfig) -> PreparedScan:
    return scan if isinstance(scan, PreparedScan) else preprocess(scan, config)


def with_grounds(result: Registration, source: PreparedScan, target: PreparedScan
                 ) -> Registration:
    """Add what is known of the two scans: their grounds, and what was odd about them."""
    warnings = (*(f'source: {w}' for w in source.warnings),
                *(f'target: {w}' for w in target.warnings))
    labelled = (source.features.labelled_share > 0, target.features.labelled_share > 0)
    if any(labelled) and not all(labelled):
        warnings += (f'labels ignored: the {"target" if labelled[0] else "source"} has none',)
    return replace(result, source_ground=source.ground, target_ground=target.ground,
                   warnings=warnings)


def _hints(result: Registration, source: PreparedScan, target: PreparedScan,
           config: SgorConfig) -> tuple[str, ...]:
    """Return what may be wrong with the scans."""
    hints = [scale_hint(result, config)]
    if not result.success:
        hints += [f'{side}: {hint}' for side, scan in (('source', source), ('target', target))
                  if (hint := frame_hint(scan.scan.points, config))]
    return tuple(filter(None, hints))


def _attempts(config: SgorConfig, *, labelled: bool, level: bool) -> Iterator[SgorConfig]:
    """Yield the settings of each attempt; the first that the clouds believe ends them.

    A quick one with few keypoints; one with all; one that trusts less: without labels, or, where
    there are none, without what stands around, which from afar looks another. Where the ground
    planes may be of walls or tables, nothing stands around, and whatever is level is tried too.
    """
    if not labelled:
        config = config.replace(semantics='none')
        less = config.replace(context_weight=0.0)
    else:
        less = config.replace(semantics='none')
    ways = (config,) if level else (
        config.replace(context_weight=0.0),
        config.replace(context_weight=0.0, ground_check=False, height_gate=0.0))
    if 0 < config.quick_keypoints < config.max_correspondences:
        for way in ways:
            yield way.replace(max_correspondences=config.quick_keypoints,
                              groups=min(config.groups, config.quick_groups),
                              group_size=max(config.quick_keypoints // 8, config.group_keep + 1))
    yield ways[0]
    if config.unlabelled_attempt and less not in (config, *ways):    # or the same once more
        yield less
    yield from ways[1:]


def _globally(source: PreparedScan, target: PreparedScan, config: SgorConfig,
              clock: Stopwatch) -> tuple[Registration, Contest | None]:
    """Match, solve, and let the clouds choose among the answer and its rivals."""
    p, q = source.features, target.features
    with clock('descriptors'):
        # made by the first attempt that needs them, and kept
        at_once(config.threads, lambda: p.descriptors, lambda: q.descriptors)
    if config.context_weight > 0:
        with clock('context'):
            at_once(config.threads, lambda: p.context, lambda: q.context)
    with clock('matching'):
        if config.correspondence_preprocessing and config.semantics != 'none':
            p, q = overlap_region(p, q)
        correspondences = match(p, q, config)
    normals = (None if source.ground is None or target.ground is None
               else (source.ground.normal, target.ground.normal))
    result = solve(correspondences, normals, (source.view, target.view), config, clock)
    with clock('rivals'):
        return compete(result, source.view, target.view, config)


def _locally(result: Registration, contest: Contest, source: PreparedScan, target: PreparedScan,
             config: SgorConfig, clock: Stopwatch) -> Registration:
    """Refine on the clouds, and judge again beside the rivals (beyond the paper)."""
    assert result.T_target_source is not None
    local = aligned(source, target, result.T_target_source, config, clock)
    return settled(result, local, contest, source, target, config, clock)


def aligned(source: PreparedScan, target: PreparedScan, T_target_source: NDArray[np.float64],
            config: SgorConfig, clock: Stopwatch) -> Alignment | None:
    """Refine a transformation on the clouds; None where that is off or they are too small."""
    with clock('surface'):
        p, q = at_once(config.threads, source.surfaced, target.surfaced)
    if p is None or q is None:
        return None
    with clock('alignment'):
        return align(p, q, T_target_source, config)


def settled(result: Registration, local: Alignment | None, contest: Contest,
            source: PreparedScan, target: PreparedScan, config: SgorConfig, clock: Stopwatch
            ) -> Registration:
    """Take the refined transformation, and judge it beside the rivals."""
    if local is not None:
        agree = distances(local.T_target_source, result.source_points,
                          result.target_points) < config.tau_1
        result = replace(result, T_target_source=local.T_target_source,
                         covariance=local.covariance, systematic=local.systematic, inliers=agree)
    with clock('acceptance'):
        return settle(result, contest, source.view, target.view, config)


def register_correspondences(source_points: ArrayLike, target_points: ArrayLike,
                             source_labels: ArrayLike | None = None,
                             target_labels: ArrayLike | None = None, *,
                             ground_normals: Normals | None = None,
                             config: SgorConfig | None = None) -> Registration:
    """Find the transformation behind matches from elsewhere.

    Parameters
    ----------
    source_points, target_points : (N, 3) array
        Row i of one is held to be the same place as row i of the other, metres.
    source_labels, target_labels : (N,) array of integers, optional
        Ids of the configured label convention; regional labels are voted among the matches.
    ground_normals : pair of (3,) arrays, optional
        Ground normals of source and target, towards the sensor; without, no ground check.
    config : SgorConfig, optional

    Raises
    ------
    InputError
        Shapes that do not fit, or values that are not finite.
    """
    config = SgorConfig.given(config)
    with cores(config.threads):
        correspondences = given_correspondences(source_points, target_points, source_labels,
                                                target_labels, config)
        result = solve(correspondences, ground_normals, None, config, Stopwatch())
        return judge_matches(result, config)


def solve(correspondences: Correspondences, ground_normals: Normals | None,
          views: tuple[View, View] | None, config: SgorConfig, clock: Stopwatch) -> Registration:
    """Remove outliers by semantic-geometric consistency and fit (Sec. III-B to III-E)."""
    found = Registration(False, '', None, correspondences.source, correspondences.target,
                         np.zeros(len(correspondences), np.bool_), timings=clock.seconds)
    if len(correspondences) < MIN_POINTS:
        return replace(found, reason=f'only {len(correspondences)} correspondences')
    with clock('consistency graph'):
        graph = consistency_graph(correspondences, config)
    with clock('grouping'):
        groups = group(correspondences, graph, config)
    with clock('consistency'):
        filtered = filter_groups(correspondences, graph, groups, config.group_keep,
                                 config.semantics)
    with clock('hypotheses'):
        hypotheses = hypothesise(correspondences, filtered)
    with clock('verification'):
        verdict = verify(hypotheses, correspondences, ground_normals, views, config)
    found = replace(found, hypotheses=hypotheses.T_target_source,
                    passed_ground_check=verdict.passed_ground_check, best_hypothesis=verdict.best,
                    hypothesis_scores=verdict.score)
    if verdict.best < 0:
        return replace(found, reason=verdict.reason)
    with clock('refinement'):
        T = refine(hypotheses.T_target_source[verdict.best], correspondences, config)
        agree = distances(T, correspondences.source, correspondences.target) < config.tau_1
    reason = unobservable(correspondences.source[agree], correspondences.target[agree], config)
    if reason:
        return replace(found, reason=reason, inliers=agree)
    return replace(found, success=True, T_target_source=T, inliers=agree)
