"""How long the solver takes: matches in, transformation out.

Made-up matches spread evenly; real ones of FPFH crowd, and more pairs of them are consistent by
chance. So both are timed, of scans with many beams and with few.
"""
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from ..core.common import se3
from ..core.config import SgorConfig
from ..core.matching.correspondences import given_correspondences
from ..core.matching.correspondences import match
from ..core.preprocessing import preprocess
from ..core.registration import register_correspondences
from ..core.scan.scan import SemanticScan
from ..core.solver.graph import consistency_graph
from .methods import packages
from .methods import problem
from .methods.files import read_set
from .metrics import rotation_error_deg
from .metrics import translation_error_m
from .pairs import Pair

Array = NDArray[np.float64]
Dense = Callable[..., Array]

BOX_M, NOISE_M = 100.0, 0.1
MADE_UP = 'made up'
FINE_VOXEL_M = 0.3
"""Of scans whose FPFH is matched: few have thousands of keypoints in coarser ones."""
DENSE_GROUPS = 20
"""Groups in the comparison with the dense reference, which would need minutes for all."""


@dataclass(frozen=True, eq=False)
class Matches:
    """Correspondences with a known answer.

    Attributes
    ----------
    name : str
    source, target : (N, 3) float64
    T_target_source : (4, 4) float64
    """

    name: str
    source: Array
    target: Array
    T_target_source: Array


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


def made_up(count: int, inlier_share: float, seed: int) -> Matches:
    """Return random points in a box, a share of them moved alike and with noise."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(0, BOX_M, (count, 3))
    T = se3.compose(Rotation.random(random_state=seed).as_matrix(), rng.uniform(-20, 20, 3))
    target = rng.uniform(0, BOX_M, (count, 3))
    right = rng.permutation(count)[:max(round(inlier_share * count), 3)]
    target[right] = se3.transform(T, source[right]) + rng.normal(0, NOISE_M, (len(right), 3))
    return Matches(MADE_UP, source, target, T)


def real_matches(folder: Path) -> Iterator[Matches]:
    """Yield the sets in ``correspondences``: ``NAME_source.txt``, ``_target``, the truth."""
    for path in sorted((folder / 'correspondences').glob('*_source.txt')):
        name = path.name.removesuffix('_source.txt')
        if name.endswith('_T_target'):
            continue
        yield Matches(name, *read_set(path.parent, name))


def fpfh_matches(pairs: Sequence[Pair], count: int) -> Iterator[Matches]:
    """Yield up to `count` matches of each pair: nearest FPFH, as the paper has it, no labels."""
    config = SgorConfig.paper().replace(voxel_size=FINE_VOXEL_M, semantics='none',
                                        max_correspondences=count)
    for pair in tqdm(pairs, 'matching', unit='pair', disable=None):
        source, target = (preprocess(SemanticScan(frame.read().points), config).features
                          for frame in (pair.source, pair.target))
        found = match(source, target, config)
        assert pair.T_target_source is not None
        yield Matches(f'{pair.data_set}, {pair.distance_m:.0f} m', found.source, found.target,
                      pair.T_target_source)


def run_solver(sets: Sequence[Matches], config: SgorConfig, runs: int, *, rivals: bool
               ) -> list[Solved]:
    """Time both presets, on one thread too, and rivals in turns, after a run to warm up."""
    paper = SgorConfig.paper().replace(threads=config.threads)
    configs = {'SGOR': config, "SGOR, paper's settings": paper}
    if config.threads > 1:
        configs |= {f'{name}, one thread': c.replace(threads=1) for name, c in configs.items()}
    solvers: dict[str, Callable[[Matches], Array | None]] = {
        name: partial(_solve, config=c) for name, c in configs.items()}
    if rivals:
        solvers["KISS-Matcher's solver"] = lambda m: packages.kiss_matcher_solver(
            problem.Matches.of(m.source, m.target, config.tau_1)).T_target_source
    return [row for matches in tqdm(sets, unit='set', disable=None)
            for row in _timed(matches, solvers, runs, config)]


def run_dense(sets: Sequence[Matches], dense: Dense) -> list[Solved]:
    """Time the dense reference and the sparse path in the same settings, once each."""
    config = SgorConfig.paper().replace(groups=DENSE_GROUPS)
    _solve(sets[0], config)
    solvers: dict[str, Callable[[Matches], Any]] = {
        f'dense numpy, {DENSE_GROUPS} groups': lambda m: dense(
            m.source, m.target, config.sigma_d, config.weight_cutoff, config.groups,
            config.group_size, config.group_keep, config.tau_1, config.key_spacing),
        f'SGOR, {DENSE_GROUPS} groups': partial(_solve, config=config)}
    return [row for matches in tqdm(sets, 'dense', unit='set', disable=None)
            for row in _timed(matches, solvers, 1, config)]


def _solve(matches: Matches, config: SgorConfig) -> Array | None:
    result = register_correspondences(matches.source, matches.target, config=config)
    return result.T_target_source if result.success else None


def _timed(matches: Matches, solvers: Mapping[str, Callable[[Matches], Any]], runs: int,
           config: SgorConfig) -> Iterator[Solved]:
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in solvers}
    answers = {}
    # the first round only warms up, unless it is the only one
    for _ in range(runs + 1 if runs > 1 else 1):
        for name, solve in solvers.items():
            start = time.perf_counter(), time.process_time()
            answers[name] = solve(matches)
            spent[name].append((time.perf_counter() - start[0], time.process_time() - start[1]))
    truth = matches.T_target_source
    residuals = np.linalg.norm(se3.transform(truth, matches.source) - matches.target, axis=1)
    shares = float((residuals < config.tau_1).mean()), _consistent_share(matches, config)
    for name, taken in spent.items():
        T, (seconds, cpu_seconds) = answers[name], np.array(taken[-runs:]).T
        yield Solved(name, matches.name, len(matches.source), *shares,
                     float(np.median(seconds)), float(np.percentile(seconds, 95)),
                     float(cpu_seconds.min()), runs,
                     float('nan') if T is None else rotation_error_deg(T, truth),
                     float('nan') if T is None else translation_error_m(T, truth))


def _consistent_share(matches: Matches, config: SgorConfig) -> float:
    given = given_correspondences(matches.source, matches.target, None, None, config)
    return len(consistency_graph(given, config).index) / len(given)**2
