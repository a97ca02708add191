"""SGOR itself, in any configuration: on raw scans, on matches, and its solver alone."""
from functools import partial
import time

import numpy as np
from numpy.typing import NDArray

from ...core.config import SgorConfig
from ...core.execution.stopwatch import Stopwatch
from ...core.execution.threads import cores
from ...core.preprocessing import preprocess
from ...core.registration import register
from ...core.registration import register_correspondences
from ...core.scan.scan import SemanticScan
from ...core.solver.solution import solve
from ..pairs.front_end import random_labels
from ..pairs.pair import Matches
from ..pairs.pair import Scans
from .method import Estimate
from .method import Method


def on_scans(name: str, config: SgorConfig, label_noise: float = 0.0, *, labels: bool = True
             ) -> Method:
    """Return SGOR on raw scans, with a share of the labels random, or without labels."""
    return Method(name, partial(_on_scans, config=config, label_noise=label_noise, labels=labels),
                  'scans')


def on_matches(name: str, config: SgorConfig, front_end: SgorConfig | None = None) -> Method:
    """Return SGOR on matches; like the others it answers, trusted or not."""
    return Method(name, partial(_on_matches, config), front_end=front_end)


def with_verdict(name: str, config: SgorConfig) -> Method:
    """Return `register_correspondences` on matches: it has no answer where it is refused."""
    return Method(name, partial(_with_verdict, config))


def _on_scans(scans: Scans, config: SgorConfig, label_noise: float, *, labels: bool) -> Estimate:
    rng = np.random.default_rng(scans.seed)
    (p, p_labels), (q, q_labels) = (
        (scan.points, _noisy(scan.labels, label_noise, rng) if labels else None)
        for scan in (scans.source, scans.target))
    begin = time.perf_counter()
    target = preprocess(SemanticScan(q, q_labels),
                        config.replace(label_convention=scans.target_convention))
    one_ready = time.perf_counter()
    source = preprocess(SemanticScan(p, p_labels),
                        config.replace(label_convention=scans.source_convention))
    result = register(source, target, config)
    end = time.perf_counter()
    # what was refused for another reason has no threshold that would let it pass
    other_reason = not result.success and result.confidence >= config.min_confidence
    return Estimate(result.T_target_source, None, result.success,
                    0.0 if other_reason else result.confidence, end - begin, end - one_ready,
                    result)


def _noisy(labels: NDArray[np.int64] | None, share: float, rng: np.random.Generator
           ) -> NDArray[np.int64] | None:
    return labels if labels is None or share == 0 else random_labels(labels, share, rng)


def _on_matches(config: SgorConfig, matches: Matches) -> Estimate:
    with cores(config.threads):
        found = solve(matches.correspondences, matches.ground_normals, None, config, Stopwatch())
    return Estimate(found.T_target_source)


def _with_verdict(config: SgorConfig, matches: Matches) -> Estimate:
    result = register_correspondences(matches.source, matches.target, config=config)
    return Estimate(result.T_target_source if result.success else None)
