"""All methods on one pair: raw scans read once, matches made once, and a row for each method."""
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import replace
import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common import se3
from ..core.config import SgorConfig
from ..core.scan.scan import SemanticScan
from .front_end import Features
from .front_end import shared_matches
from .methods import Answer
from .methods import Matches
from .methods import Method
from .methods import ScanPair
from .metrics.inliers import inlier_scores
from .metrics.inliers import kept_scores
from .metrics.pose_error import nees
from .metrics.pose_error import rotation_error_deg
from .metrics.pose_error import translation_error_m
from .metrics.row import Row
from .protocols.pairs import Pair
from .protocols.protocol import Protocol
from .protocols.studies import Variant

Array = NDArray[np.float64]

TILT_RAD = math.radians(2.0)
NAN = float('nan')


def turned(pair: Pair, seed: int) -> tuple[ScanPair, Array | None]:
    """Read a pair and turn its source; return it with the true T_target_source of what is left.

    Yaw is uniform, roll and pitch are normal with 2 degrees.
    """
    rng = np.random.default_rng(seed)
    R = Rotation.from_euler('zyx', [rng.uniform(0, 2 * np.pi), *rng.normal(0, TILT_RAD, 2)])
    scans = raw_scans(pair, seed)
    T_turned_source = se3.compose(R.as_matrix(), np.zeros(3))
    points = se3.transform(T_turned_source, scans.source.points.astype(np.float64))
    source = SemanticScan(points.astype(np.float32), scans.source.labels)
    truth = (None if pair.T_target_source is None
             else pair.T_target_source @ se3.inverse(T_turned_source))
    return replace(scans, source=source), truth


def raw_scans(pair: Pair, seed: int = 0) -> ScanPair:
    """Read the scans of a pair."""
    source, target = pair.scans
    return ScanPair(source.read(), target.read(), source.label_convention,
                    target.label_convention, seed)


@dataclass(frozen=True, eq=False)
class Job:
    """All methods on one pair in one variant: what goes to another process.

    Attributes
    ----------
    protocol : Protocol
        Of this pair alone.
    variant : Variant
    methods : sequence of Method
        In the order to run them in.
    features : Features or None
    turn_seed : int or None
        Turns the source for methods on raw scans; None: they get it as it is.
    """

    protocol: Protocol
    variant: Variant
    methods: Sequence[Method]
    features: Features | None = None
    turn_seed: int | None = None

    def __call__(self) -> list[Row]:
        """Run them on the same scans and the same matches, each of which is made once."""
        pair, = self.protocol.pairs
        made: dict[SgorConfig, Matches] = {}
        scans: tuple[ScanPair, Array | None] | None = None
        rows = []
        for method in self.methods:
            if method.on_scans is not None:
                if scans is None:
                    scans = ((raw_scans(pair), pair.T_target_source) if self.turn_seed is None
                             else turned(pair, self.turn_seed))
                begin = time.perf_counter()
                answer = method.on_scans(scans[0])
                rows.append(self._row(method, scans[1], answer, time.perf_counter() - begin))
                continue
            config = method.front_end or self.protocol.front_end
            if config not in made:
                made[config] = shared_matches(pair, config, self.protocol.inlier_m, self.variant,
                                              self.features)
            begin = time.perf_counter()
            assert method.on_matches is not None
            answer = method.on_matches(made[config])
            seconds = time.perf_counter() - begin
            row = self._row(method, pair.T_target_source, answer, seconds)
            rows.append(replace(row, **self._of_matches(made[config], answer)))
        return rows

    def _row(self, method: Method, truth: Array | None, answer: Answer, seconds: float) -> Row:
        pair, = self.protocol.pairs
        T, result = answer.T_target_source, answer.result
        re = te = squared = NAN
        if truth is not None and T is not None and np.isfinite(T).all():
            known = np.array([1.0, 1.0, float(pair.heights_known), 1.0])[:, None]
            re = rotation_error_deg(T, truth)
            te = translation_error_m(*(known * np.asarray(each) for each in (T, truth)))
            if result is not None and pair.heights_known:
                squared = nees(T, truth, result.covariance)
        named: dict[str, Any] = {} if pair.matches is not None else {
            'data_set': pair.data_set, 'source': pair.scans[0].name,
            'target': pair.scans[1].name}
        of_sgor: dict[str, Any] = {} if result is None else {
            'confidence': NAN if T is None else result.confidence,
            'degenerate': len(result.degenerate), 'alternatives': len(result.alternatives)}
        row = Row(method=method.name, pair=pair.name, group=pair.group, variant=self.variant.name,
                  right=pair.right, distance_m=pair.distance_m, rotation_error_deg=re,
                  translation_error_m=te, within=False, valid=answer.valid and T is not None,
                  score=answer.score, nees=squared, seconds_one_new=answer.seconds_one_new,
                  seconds=seconds if np.isnan(answer.seconds) else answer.seconds,
                  **named, **of_sgor)
        return replace(row, within=row.below(self.protocol.thresholds[0]))

    def _of_matches(self, matches: Matches, answer: Answer) -> dict[str, Any]:
        """Return the figures of the matches that a method kept, and of those that it was given."""
        pair, = self.protocol.pairs
        truth, T, inlier_m = pair.T_target_source, answer.T_target_source, self.protocol.inlier_m
        assert truth is not None
        true = np.linalg.norm(matches.source @ truth[:3, :3].T + truth[:3, 3] - matches.target,
                              axis=1) < inlier_m
        found: dict[str, Any] = {'matches': len(true), 'precision': 0.0, 'recall': 0.0, 'f1': 0.0,
                                 'right_share': float(np.mean(true)) if len(true) else 0.0}
        clouds = matches.source, matches.target
        if answer.kept is not None:
            found |= asdict(kept_scores(*clouds, answer.kept, truth, inlier_m))
        elif T is not None:
            found |= asdict(inlier_scores(*clouds, T, truth, inlier_m))
        return found
