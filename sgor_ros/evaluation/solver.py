"""How long the solver takes: matches in, transformation out.

Made-up matches spread evenly; real ones of FPFH crowd, and more pairs of them are consistent by
chance. So both are timed, of scans with many beams and with few.
"""
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import time

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common import se3
from ..core.config import SgorConfig
from ..core.matching.correspondences import match
from ..core.preprocessing import preprocess
from ..core.scan.scan import SemanticScan
from ..core.solver.graph import consistency_graph
from ..io.terminal import progress
from . import dense_reference
from .methods import Answer
from .methods import Matches
from .methods import Method
from .methods import sgor_on_matches
from .metrics.pose_error import rotation_error_deg
from .metrics.pose_error import translation_error_m
from .protocols.match_files import read_set
from .protocols.pairs import Pair
from .protocols.protocol import INLIER_M

Array = NDArray[np.float64]

BOX_M, NOISE_M = 100.0, 0.1
MADE_UP = 'made up'
FINE_VOXEL_M = 0.3
"""Of scans whose FPFH is matched: few have thousands of keypoints in coarser ones."""
DENSE_GROUPS = 20
"""Groups in the comparison with the dense reference, which would need minutes for all."""


@dataclass(frozen=True)
class Solved:
    """Times of one solver on one set of matches; RE in degrees, TE in metres, NaN if it failed.

    Attributes
    ----------
    consistent_share : float
        Of all pairs of matches (M', Eq. 6).
    cpu_seconds : float
        Of all threads, the least of all runs: what other processes disturb least.
    """

    solver: str
    matches: str
    count: int
    inlier_share: float
    consistent_share: float
    seconds_median: float
    seconds_p95: float
    cpu_seconds: float
    runs: int
    rotation_error_deg: float
    translation_error_m: float


def made_up(count: int, inlier_share: float, seed: int) -> Pair:
    """Return random points in a box, a share of them moved alike and with noise."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(0, BOX_M, (count, 3))
    T = se3.compose(Rotation.random(random_state=seed).as_matrix(), rng.uniform(-20, 20, 3))
    target = rng.uniform(0, BOX_M, (count, 3))
    right = rng.permutation(count)[:max(round(inlier_share * count), 3)]
    target[right] = se3.transform(T, source[right]) + rng.normal(0, NOISE_M, (len(right), 3))
    return _pair(MADE_UP, source, target, T)


def real_matches(folder: Path) -> Iterator[Pair]:
    """Yield the sets in ``correspondences``: ``NAME_source.txt``, ``_target``, the truth."""
    for path in sorted((folder / 'correspondences').glob('*_source.txt')):
        name = path.name.removesuffix('_source.txt')
        if name.endswith('_T_target'):
            continue
        yield _pair(name, *read_set(path.parent, name))


def fpfh_matches(pairs: Sequence[Pair], count: int) -> Iterator[Pair]:
    """Yield up to `count` matches of each pair: nearest FPFH, as the paper has it, no labels."""
    config = SgorConfig.paper().replace(voxel_size=FINE_VOXEL_M, semantics='none',
                                        max_correspondences=count)
    with progress('matching', len(pairs), 'pair') as told:
        for pair in told.over(pairs):
            source, target = (preprocess(SemanticScan(frame.read().points), config).features
                              for frame in pair.scans)
            found = match(source, target, config)
            assert pair.T_target_source is not None
            yield _pair(f'{pair.data_set}, {pair.distance_m:.0f} m', found.source, found.target,
                        pair.T_target_source)


def _pair(name: str, source: Array, target: Array, T_target_source: Array) -> Pair:
    return Pair(None, None, T_target_source, name=name,
                matches=Matches.of(source, target, INLIER_M))


def run_solver(sets: Sequence[Pair], config: SgorConfig, runs: int, others: Sequence[Method]
               ) -> list[Solved]:
    """Time both presets, on one thread too, and others in turns, after a run to warm up."""
    paper = SgorConfig.paper().replace(threads=config.threads)
    configs = {'SGOR': config, "SGOR, paper's settings": paper}
    if config.threads > 1:
        configs |= {f'{name}, one thread': c.replace(threads=1) for name, c in configs.items()}
    solvers = [*(sgor_on_matches(name, c) for name, c in configs.items()), *others]
    with progress('solvers', len(sets), 'set') as told:
        return [row for pair in told.over(sets) for row in _timed(pair, solvers, runs, config)]


def run_dense(sets: Sequence[Pair]) -> list[Solved]:
    """Time the dense reference and the sparse path in the same settings, once each."""
    config = SgorConfig.paper().replace(groups=DENSE_GROUPS)
    sparse = sgor_on_matches(f'SGOR, {DENSE_GROUPS} groups', config)
    _answer(sparse, sets[0])
    dense = Method(f'dense numpy, {DENSE_GROUPS} groups', on_matches=partial(_dense, config))
    with progress('dense', len(sets), 'set') as told:
        return [row for pair in told.over(sets)
                for row in _timed(pair, (dense, sparse), 1, config)]


def _dense(config: SgorConfig, matches: Matches) -> Answer:
    return Answer(dense_reference.solve(
        matches.source, matches.target, config.sigma_d, config.weight_cutoff, config.groups,
        config.group_size, config.group_keep, config.tau_1, config.key_spacing))


def _answer(method: Method, pair: Pair) -> Answer:
    assert method.on_matches is not None
    assert pair.matches is not None
    return method.on_matches(pair.matches)


def _timed(pair: Pair, solvers: Sequence[Method], runs: int, config: SgorConfig
           ) -> Iterator[Solved]:
    spent: dict[str, list[tuple[float, float]]] = {solver.name: [] for solver in solvers}
    answers = {}
    # the first round only warms up, unless it is the only one
    for _ in range(runs + 1 if runs > 1 else 1):
        for solver in solvers:
            start = time.perf_counter(), time.process_time()
            answers[solver.name] = _answer(solver, pair)
            spent[solver.name].append((time.perf_counter() - start[0],
                                       time.process_time() - start[1]))
    truth, matches = pair.T_target_source, pair.matches
    assert truth is not None
    assert matches is not None
    residuals = np.linalg.norm(se3.transform(truth, matches.source) - matches.target, axis=1)
    consistent = len(consistency_graph(matches.correspondences, config).index)
    for name, taken in spent.items():
        answer, (seconds, cpu_seconds) = answers[name], np.array(taken[-runs:]).T
        T = answer.T_target_source if answer.valid else None
        yield Solved(name, pair.name, len(residuals), float((residuals < config.tau_1).mean()),
                     consistent / len(residuals)**2,
                     float(np.median(seconds)), float(np.percentile(seconds, 95)),
                     float(cpu_seconds.min()), runs,
                     float('nan') if T is None else rotation_error_deg(T, truth),
                     float('nan') if T is None else translation_error_m(T, truth))
