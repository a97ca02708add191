"""Sets of matches to time solvers on: made up, from files, and of the FPFH of scans.

Made-up matches spread evenly; real ones of FPFH crowd, and more pairs of them are consistent by
chance. So both are timed, of scans with many beams and with few.
"""
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...core.common import se3
from ...core.config import SgorConfig
from ...core.matching.correspondences import match
from ...core.preprocessing import preprocess
from ...core.scan.scan import SemanticScan
from .. import dense_reference
from ..extra import progress
from ..methods.method import Estimate
from ..methods.method import Method
from ..methods.sgor import with_verdict
from ..metrics.registration import EASY
from ..pairs.files import read_pair
from ..pairs.pair import Matches
from ..pairs.pair import Pair
from .protocol import Protocol

BOX_M, NOISE_M = 100.0, 0.1
MADE_UP = 'made up'
FINE_VOXEL_M = 0.3
"""Of scans whose FPFH is matched: few have thousands of keypoints in coarser ones."""
DENSE_GROUPS = 20
"""Groups in the comparison with the dense reference, which would need minutes for all."""
DENSE_CONFIG = SgorConfig.paper().replace(groups=DENSE_GROUPS)
INLIER_M = SgorConfig().tau_1


def solver_protocol(pairs: Sequence[Pair]) -> Protocol:
    """Return sets of matches as a protocol."""
    return Protocol('sets', pairs, (EASY,), INLIER_M, SgorConfig())


def made_up(count: int, inlier_share: float, seed: int) -> Pair:
    """Return random points in a box, a share of them moved alike and with noise."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(0, BOX_M, (count, 3))
    T = se3.compose(Rotation.random(random_state=seed).as_matrix(), rng.uniform(-20, 20, 3))
    target = rng.uniform(0, BOX_M, (count, 3))
    right = rng.permutation(count)[:max(round(inlier_share * count), 3)]
    target[right] = se3.transform(T, source[right]) + rng.normal(0, NOISE_M, (len(right), 3))
    return Pair(None, None, T, name=MADE_UP, matches=Matches.of(source, target, INLIER_M))


def real_matches(folder: Path) -> Iterator[Pair]:
    """Yield the sets in ``correspondences``: ``NAME_source.txt``, ``_target``, the truth."""
    for path in sorted((folder / 'correspondences').glob('*_source.txt')):
        name = path.name.removesuffix('_source.txt')
        if not name.endswith('_T_target'):
            yield read_pair(path.parent, name, INLIER_M)


def fpfh_matches(pairs: Sequence[Pair], count: int) -> Iterator[Pair]:
    """Yield up to `count` matches of each pair: nearest FPFH, as the paper has it, no labels."""
    config = SgorConfig.paper().replace(voxel_size=FINE_VOXEL_M, semantics='none',
                                        max_correspondences=count)
    for pair in progress(pairs, 'matching'):
        source, target = (preprocess(SemanticScan(scan.read().points), config).features
                          for scan in pair.scans)
        found = match(source, target, config)
        yield Pair(None, None, pair.T_target_source, name=f'{pair.group}, {pair.distance_m:.0f} m',
                   matches=Matches.of(found.source, found.target, INLIER_M))


def presets(config: SgorConfig) -> list[Method]:
    """Return both presets, on one thread too."""
    configs = {'SGOR': config,
               "SGOR, paper's settings": SgorConfig.paper().replace(threads=config.threads)}
    if config.threads > 1:
        configs |= {f'{name}, one thread': c.replace(threads=1) for name, c in configs.items()}
    return [with_verdict(name, c) for name, c in configs.items()]


def dense_and_sparse() -> list[Method]:
    """Return the dense reference and SGOR in the same settings."""
    return [Method(f'dense numpy, {DENSE_GROUPS} groups', _dense),
            with_verdict(f'SGOR, {DENSE_GROUPS} groups', DENSE_CONFIG)]


def _dense(matches: Matches) -> Estimate:
    config = DENSE_CONFIG
    solve: Callable[..., NDArray[np.float64]] = dense_reference.solve
    return Estimate(solve(
        matches.source, matches.target, config.sigma_d, config.weight_cutoff, config.groups,
        config.group_size, config.group_keep, config.tau_1, config.key_spacing))
