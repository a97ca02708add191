"""SGOR on one screen: `register` two scans, or what is behind matches from elsewhere."""
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray

from .common.settings import InputError
from .config import SgorConfig
from .execution.stopwatch import Stopwatch
from .execution.tasks import run_both
from .execution.threads import cores
from .hypotheses.competing import compete
from .hypotheses.competing import HypothesisTest
from .icp.gicp import align
from .icp.gicp import Alignment
from .matching.correspondences import given_correspondences
from .matching.correspondences import match
from .matching.correspondences import overlap_region
from .prepared_scan import as_scan
from .prepared_scan import PreparedScan
from .preprocessing import at_scale
from .preprocessing import preprocess
from .scan.scan import SemanticScan
from .scoring.pose_scoring import pose_score
from .scoring.pose_scoring import PoseScore
from .solver.solution import Solution
from .solver.solution import solve
from .solver.verification import Normals
from .verdict.decision import decide
from .verdict.decision import decide_by_matches
from .verdict.decision import low_confidence
from .verdict.decision import no_solution
from .verdict.decision import Pair
from .verdict.decision import refuse
from .verdict.hints import frame_hint
from .verdict.hints import scale_hint
from .verdict.result import Registration
from .verdict.result import Result

Scan = SemanticScan | PreparedScan

FEWEST_INLIERS = 5
"""Enough for a pose that the clouds bear out: far apart, scans have few matches in common."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """What one way to match two scans led to; `test` is None without a solution."""

    solution: Solution
    test: HypothesisTest | None

    @property
    def score(self) -> PoseScore:
        """That of the pose; zero without one."""
        return PoseScore(0.0, 0.0) if self.test is None else pose_score(self.test.outcomes)


def register(source: Scan | ArrayLike, target: Scan | ArrayLike,
             config: SgorConfig | None = None) -> Result:
    """Find the transformation between two overlapping scans, without an initial guess.

    Parameters
    ----------
    source, target : SemanticScan, PreparedScan or (N, 3) array
        Prepared scans are used as they are: prepare once, register often. Arrays are points
        without labels, metres.
    config : SgorConfig, optional
        Where none is given, that of a prepared scan, or ``SgorConfig()``.

    Returns
    -------
    Registration
        Where the scans cannot be registered its `status` and `reason` say why.

    Raises
    ------
    InputError
        What is no scan, or no configuration; a scan that was prepared with another one.
    """
    scans = as_scan(source, 'source'), as_scan(target, 'target')
    config = _configuration(*scans, config)
    clock = Stopwatch()
    with cores(config.threads):
        one, other = _prepared(*scans, config, clock)
        config = config.scaled(one.scale)
        found = _best_attempt(one, other, config, clock)
        pair = Pair(one, other, found.solution.correspondences.source,
                    found.solution.correspondences.target, found.solution, clock.seconds)
        if found.test is None:
            result = no_solution(pair, config)
        elif found.score.confidence < config.min_confidence:
            result = refuse(pair, found.test, low_confidence(found.score, config), config)
        else:
            alignment = aligned(one, other, found.test.T_target_source, config, clock)
            with clock('verdict'):
                result = decide(pair, found.test, alignment, config)
        hints = _hints(result, one, other, config)
    return cast('Result', replace(result, warnings=(*result.warnings, *hints)) if hints
                else result)


def _configuration(source: Scan, target: Scan, asked: SgorConfig | None) -> SgorConfig:
    """Return the configuration to register with; prepared scans bring theirs, or fit it."""
    prepared = {name: scan for name, scan in (('source', source), ('target', target))
                if isinstance(scan, PreparedScan)}
    if asked is None and prepared:
        config = next(iter(prepared.values())).config
    else:
        config = SgorConfig.given(asked)
    for name, scan in prepared.items():
        scan.check(config, name)
        if asked is not None and config.scale not in (0.0, scan.scale):
            raise InputError(f'{name}: prepared at scale {scan.scale:g}, not at {config.scale:g}; '
                             'preprocess it with the configuration of the registration')
    return config


def _prepared(one: Scan, other: Scan, config: SgorConfig, clock: Stopwatch
              ) -> tuple[PreparedScan, PreparedScan]:
    """Return both scans prepared, at one scale."""
    def prepare(scan: Scan) -> PreparedScan:
        return scan if isinstance(scan, PreparedScan) else preprocess(scan, config)

    with clock('preprocessing'):
        source, target = run_both(config.threads, partial(prepare, one), partial(prepare, other))
        if source.scale != target.scale:    # the coarser one costs less and sees farther
            scale = max(source.scale, target.scale)
            source, target = at_scale(source, scale), at_scale(target, scale)
    return source, target


def _best_attempt(source: PreparedScan, target: PreparedScan, config: SgorConfig,
                  clock: Stopwatch) -> Attempt:
    """Return the first attempt above min_confidence; where there is none, the best."""
    labelled = all(scan.features.labelled_share > 0 for scan in (source, target))
    doubtful = any(not scan.ground.certain if scan.ground else scan.scale < 1
                   for scan in (source, target))
    best: Attempt | None = None
    for way in _attempts(config, labelled=labelled, level=not doubtful):
        found = _attempt(source, target, way, clock)
        if found.test is not None and found.score.confidence >= config.min_confidence:
            return found
        if best is None or found.score.confidence >= best.score.confidence:
            best = found
    assert best is not None
    return best


def _attempts(config: SgorConfig, *, labelled: bool, level: bool) -> Iterator[SgorConfig]:
    """Yield the settings of each attempt.

    A quick one with few keypoints; one with all; one that trusts less: without labels, or, where
    there are none, without what stands around, which from afar looks another. Where the ground
    planes may be of walls or tables, nothing stands around, and whatever is level is tried too.
    """
    if config.min_inliers == SgorConfig.min_inliers:    # nobody asked for more
        config = config.replace(min_inliers=FEWEST_INLIERS)
    if not labelled:
        config = config.replace(semantics='none')
        less = config.replace(context_weight=0.0)
    else:
        less = config.replace(semantics='none')
    ways = (config,) if level else (
        config.replace(context_weight=0.0),
        config.replace(context_weight=0.0, ground_check=False, height_gate=0.0))
    if 0 < config.quick_keypoints < config.max_correspondences:
        yield from map(with_few_keypoints, ways)
    yield ways[0]
    if config.unlabelled_attempt and less not in (config, *ways):    # or the same once more
        yield less
    yield from ways[1:]


def with_few_keypoints(config: SgorConfig) -> SgorConfig:
    """Return the settings of a quick attempt: of `register` alone, where one is to be enough."""
    if not 0 < config.quick_keypoints < config.max_correspondences:
        return config
    return config.replace(max_correspondences=config.quick_keypoints,
                          groups=min(config.groups, config.quick_groups),
                          group_size=max(config.quick_keypoints // 8, config.group_keep + 1))


def _attempt(source: PreparedScan, target: PreparedScan, config: SgorConfig, clock: Stopwatch
             ) -> Attempt:
    """Match, solve, and let the clouds choose among the solution and what competes with it."""
    p, q = source.features, target.features
    with clock('descriptors'):
        # made by the first attempt that needs them, and kept
        run_both(config.threads, lambda: p.descriptors, lambda: q.descriptors)
    if config.context_weight > 0:
        with clock('context'):
            run_both(config.threads, lambda: p.context, lambda: q.context)
    with clock('matching'):
        if config.correspondence_preprocessing and config.semantics != 'none':
            p, q = overlap_region(p, q)
        correspondences = match(p, q, config)
    normals = (None if source.ground is None or target.ground is None
               else (source.ground.normal, target.ground.normal))
    solution = solve(correspondences, normals, (source.index, target.index), config, clock)
    if solution.T_target_source is None:
        return Attempt(solution, None)
    with clock('competing hypotheses'):
        return Attempt(solution, compete(source.index, target.index, solution.T_target_source,
                                         solution.ranked_hypotheses, config))


def aligned(source: PreparedScan, target: PreparedScan, T_target_source: NDArray[np.float64],
            config: SgorConfig, clock: Stopwatch) -> Alignment | None:
    """Refine a transformation on the clouds; None where that is off or they are too small."""
    if not config.local_refinement:
        return None
    with clock('surface'):
        p, q = run_both(config.threads, source.surfaced, target.surfaced)
    if p is None or q is None:
        return None
    with clock('alignment'):
        return align(p, q, T_target_source, config)


def _hints(result: Registration, source: PreparedScan, target: PreparedScan,
           config: SgorConfig) -> tuple[str, ...]:
    """Return what may be wrong with the scans."""
    hints = [scale_hint(result, config)]
    if not result.success:
        hints += [f'{side}: {hint}' for side, scan in (('source', source), ('target', target))
                  if scan.scan and (hint := frame_hint(
                      scan.scan.seen_from_sensor(scan.scan.points), config))]
    return tuple(filter(None, hints))


def register_correspondences(source_points: ArrayLike, target_points: ArrayLike,
                             source_labels: ArrayLike | None = None,
                             target_labels: ArrayLike | None = None, *,
                             ground_normals: Normals | None = None,
                             config: SgorConfig | None = None) -> Result:
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
    clock = Stopwatch()
    with cores(config.threads):
        correspondences = given_correspondences(source_points, target_points, source_labels,
                                                target_labels, config)
        solution = solve(correspondences, ground_normals, None, config, clock)
        return cast('Result', decide_by_matches(solution, config, clock.seconds))
