"""SGOR itself, in any configuration, on raw scans or on given matches."""
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
from .interface import Answer
from .interface import Matches
from .interface import Method
from .interface import ScanPair


def sgor(name: str, config: SgorConfig, label_noise: float = 0.0, *, labels: bool = True
         ) -> Method:
    """Return SGOR on raw scans, with a share of the labels random, or without labels."""
    return Method(name, partial(_on_scans, config=config, label_noise=label_noise, labels=labels))


def sgor_on_matches(name: str, config: SgorConfig) -> Method:
    """Return SGOR on matches without their labels, with its verdict."""
    return Method(name, on_matches=partial(_on_matches, config))


def sgor_solver(name: str, config: SgorConfig, front_end: SgorConfig | None = None) -> Method:
    """Return the solver of SGOR; like those of others it answers, trusted or not."""
    return Method(name, on_matches=partial(_solver, config), front_end=front_end)


def _on_scans(pair: ScanPair, config: SgorConfig, label_noise: float, *, labels: bool) -> Answer:
    rng = np.random.default_rng(pair.seed)
    (p, p_labels), (q, q_labels) = (
        (scan.points, _spoiled(scan.labels, label_noise, rng) if labels else None)
        for scan in (pair.source, pair.target))
    begin = time.perf_counter()
    target = preprocess(SemanticScan(q, q_labels),
                        config.replace(label_convention=pair.target_convention))
    one_ready = time.perf_counter()
    source = preprocess(SemanticScan(p, p_labels),
                        config.replace(label_convention=pair.source_convention))
    result = register(source, target, config)
    end = time.perf_counter()
    # what was refused for another reason has no threshold that would let it pass
    other_reason = not result.success and result.confidence >= config.min_confidence
    return Answer(result.T_target_source, seconds=end - begin, valid=result.success,
                  score=0.0 if other_reason else result.confidence,
                  seconds_one_new=end - one_ready, result=result)


def _on_matches(config: SgorConfig, matches: Matches) -> Answer:
    result = register_correspondences(matches.source, matches.target, config=config)
    return Answer(result.T_target_source, valid=result.success, score=result.confidence,
                  result=result)


def _solver(config: SgorConfig, matches: Matches) -> Answer:
    with cores(config.threads):
        found = solve(matches.correspondences, matches.ground_normals, None, config, Stopwatch())
    return Answer(found.T_target_source)


def _spoiled(labels: NDArray[np.int64] | None, share: float, rng: np.random.Generator
             ) -> NDArray[np.int64] | None:
    return labels if labels is None or share == 0 else random_labels(labels, share, rng)


def random_labels(labels: NDArray[np.int64], share: float, rng: np.random.Generator
                  ) -> NDArray[np.int64]:
    """Replace a share of the labels (N,) by random ones of those that occur."""
    wrong = rng.random(len(labels)) < share
    return np.where(wrong, rng.choice(np.unique(labels), len(labels)), labels)
