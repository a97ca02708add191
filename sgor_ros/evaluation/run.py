"""Runs methods on the same pairs, in turns, so that noise of the machine hits all alike."""
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
import math
import multiprocessing
from pathlib import Path
import time

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from ..core.common import se3
from ..core.config import SgorConfig
from ..core.preprocessing import preprocess
from ..core.registration import register
from ..core.scan.scan import SemanticScan
from .metrics import rotation_error_deg
from .metrics import squared_normalised_error
from .metrics import translation_error_m
from .pairs import Pair
from .pairs import random_labels
from .rivals import Answer
from .rivals import fast_global
from .rivals import kiss_matcher
from .rivals import Points
from .rivals import ransac

Array = NDArray[np.float64]

MAX_RE_DEG, MAX_TE_M = 5.0, 0.6
"""Within both a registration counts as right: the strict KITTI thresholds."""

TILT_RAD = math.radians(2.0)


@dataclass(frozen=True, eq=False)
class Sample:
    """A pair as the methods get it.

    Attributes
    ----------
    source, target : SemanticScan
        The source is turned by a random yaw and a small tilt.
    source_convention, target_convention : str
        What their labels mean.
    seed : int
        For methods that spoil labels.
    """

    source: SemanticScan
    target: SemanticScan
    source_convention: str
    target_convention: str
    seed: int


@dataclass(frozen=True, eq=False)
class Method:
    """A way to register two scans; `run` can be sent to another process."""

    name: str
    run: Callable[[Sample], Answer]
    refuses: bool = True


@dataclass(frozen=True)
class Row:
    """What one method made of one pair; RE in degrees, TE in metres, NaN without an answer.

    The last four are what SGOR alone says: confidence, count of degenerate directions and of
    alternatives, and the error measured by the covariance.
    """

    method: str
    data_set: str
    source: str
    target: str
    right: bool
    distance_m: float
    rotation_error_deg: float
    translation_error_m: float
    within: bool
    valid: bool
    score: float
    seconds: float
    seconds_one_new: float
    confidence: float = float('nan')
    degenerate: int = 0
    alternatives: int = 0
    nees: float = float('nan')

    @property
    def success(self) -> bool:
        """Whether there is a right answer that the method stands by."""
        return self.valid and self.within

    @property
    def false_accept(self) -> bool:
        """Whether the method stands by a wrong answer."""
        return self.valid and not self.within


def sgor(name: str, config: SgorConfig, label_noise: float = 0.0, *, labels: bool = True
         ) -> Method:
    """Return SGOR as a method, with a share of the labels random, or without labels."""
    return Method(name, partial(_sgor, config=config, label_noise=label_noise, labels=labels))


def _sgor(sample: Sample, config: SgorConfig, label_noise: float, *, labels: bool) -> Answer:
    rng = np.random.default_rng(sample.seed)
    (p, p_labels), (q, q_labels) = (
        (scan.points, _spoiled(scan.labels, label_noise, rng) if labels else None)
        for scan in (sample.source, sample.target))
    begin = time.perf_counter()
    target = preprocess(SemanticScan(q, q_labels),
                        config.replace(label_convention=sample.target_convention))
    one_ready = time.perf_counter()
    source = preprocess(SemanticScan(p, p_labels),
                        config.replace(label_convention=sample.source_convention))
    result = register(source, target, config)
    end = time.perf_counter()
    # what was refused for another reason has no threshold that would let it pass
    other_reason = not result.success and result.confidence >= config.min_confidence
    return Answer(result.T_target_source, end - begin, result.success,
                  0.0 if other_reason else result.confidence, end - one_ready, result)


def _spoiled(labels: NDArray[np.int64] | None, share: float, rng: np.random.Generator
             ) -> NDArray[np.int64] | None:
    return labels if labels is None or share == 0 else random_labels(labels, share, rng)


def rival(name: str, function: Callable[..., Answer], voxel_m: float, *, refuses: bool) -> Method:
    """Return a rival as a method; it sees no labels."""
    return Method(f'{name}, voxel {voxel_m:g}', partial(_rival, function, voxel_m), refuses)


def _rival(function: Callable[[Points, Points, float], Answer], voxel_m: float, sample: Sample
           ) -> Answer:
    return function(sample.source.points, sample.target.points, voxel_m)


def rivals(say: Callable[[str], None]) -> dict[str, Method]:
    """Return the rivals that are installed, by the names to ask for them."""
    found = {}
    if installed('kiss_matcher', say):
        for voxel_m in (0.3, 0.5):
            found[f'kiss-matcher-{voxel_m}'] = rival('KISS-Matcher', kiss_matcher, voxel_m,
                                                     refuses=True)
    if installed('open3d', say):
        found['ransac'] = rival('Open3D RANSAC', ransac, 0.5, refuses=False)
        found['fgr'] = rival('Open3D FGR', fast_global, 0.5, refuses=False)
    return found


def installed(module: str, say: Callable[[str], None]) -> bool:
    """Tell whether a rival's module is there, and say so if it is not."""
    if find_spec(module) is not None:
        return True
    say(f'{module} is not installed, so left out; to have it: pip install {module}')
    return False


def sample_of(pair: Pair, seed: int) -> tuple[Sample, Array | None]:
    """Read a pair and turn its source; return it with the true T_target_source of what is left.

    Yaw is uniform, roll and pitch are normal with 2 degrees.
    """
    rng = np.random.default_rng(seed)
    R = Rotation.from_euler('zyx', [rng.uniform(0, 2 * np.pi), *rng.normal(0, TILT_RAD, 2)])
    source, target = pair.source.read(), pair.target.read()
    T_turned_source = se3.compose(R.as_matrix(), np.zeros(3))
    turned = se3.transform(T_turned_source, source.points.astype(np.float64))
    sample = Sample(SemanticScan(turned.astype(np.float32), source.labels), target,
                    pair.source.label_convention, pair.target.label_convention, seed)
    truth = (None if pair.T_target_source is None
             else pair.T_target_source @ se3.inverse(T_turned_source))
    return sample, truth


def run_pairs(pairs: Sequence[Pair], methods: Sequence[Method], seed: int) -> list[Row]:
    """Run each method on each pair, pair by pair in changing order, after a run to warm up."""
    for method in methods:
        method.run(sample_of(pairs[0], seed)[0])
    rng = np.random.default_rng(seed)
    rows = []
    for index, pair in enumerate(tqdm(pairs, unit='pair', disable=None)):
        sample, truth = sample_of(pair, seed + index)
        for chosen in rng.permutation(len(methods)):
            answer = methods[chosen].run(sample)
            rows.append(_judged(methods[chosen].name, pair, truth, answer))
    return rows


def _judged(method: str, pair: Pair, truth: Array | None, answer: Answer) -> Row:
    re = te = nees = float('nan')
    result = answer.result
    T = answer.T_target_source
    if truth is not None and T is not None and np.isfinite(T).all():
        known = np.array([1.0, 1.0, float(pair.heights_known), 1.0])[:, None]
        re = rotation_error_deg(T, truth)
        te = translation_error_m(*(known * np.asarray(each) for each in (T, truth)))
        if result is not None and pair.heights_known:
            nees = squared_normalised_error(T, truth, result.covariance)
    trust = ((float('nan') if T is None else result.confidence, len(result.degenerate),
              len(result.alternatives), nees) if result is not None else ())
    return Row(method, pair.data_set, pair.source.name, pair.target.name, pair.right,
               pair.distance_m, re, te, re < MAX_RE_DEG and te < MAX_TE_M,
               answer.valid and T is not None, answer.score, answer.seconds,
               answer.seconds_one_new, *trust)


def peak_memory_mb(methods: Iterable[Method], sample: Sample) -> dict[str, float]:
    """Return the peak memory of a process of its own for each method, by name, and for none.

    A high-water mark cannot be reset, so methods in one process would share it.
    """
    spawn = multiprocessing.get_context('spawn')
    nothing = Method('', _nothing)
    found = {}
    for method in (nothing, *methods):
        with ProcessPoolExecutor(1, mp_context=spawn) as process:
            found[method.name] = process.submit(_peak, method, sample).result()
    return found


def _nothing(_: Sample) -> Answer:
    return Answer(None, 0.0, False, 0.0)


def _peak(method: Method, sample: Sample) -> float:
    for _ in range(3):
        method.run(sample)
    # ru_maxrss would start from that of the parent
    status = Path('/proc/self/status').read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in status if line.startswith('VmHWM'))
