"""`sgor_benchmark calibrate`: fit the confidence again, and check it on what was left out."""
from argparse import ArgumentParser
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.registration import register
from ...core.verdict.result import Status
from ...evaluation.calibration import fit
from ...evaluation.calibration import left_out
from ...evaluation.calibration import quality
from ...evaluation.calibration import Sample
from ...evaluation.metrics.pose_error import rotation_error_deg
from ...evaluation.metrics.pose_error import translation_error_m
from ...evaluation.protocols import pairs as pairing
from ...evaluation.protocols.pairs import Pair
from ...evaluation.report.calibration_plot import plot_calibration
from ...evaluation.report.tables import markdown
from ...io.datasets import DriveScan
from ..scene_pairs import scene_kinds
from ..scene_pairs import scene_pairs
from . import inputs
from .numbers import count

HELP = ('fit the confidence on sensors and places of the built-in world and on drives, and show '
        'how far off it is on sensors and places that were left out')
LABELS = ('none', 'true', 'wrong by 30 %')
RIGHT_M, RIGHT_DEG = 0.6, 5.0
"""Within both a pose is right; where heights of the truth are poor, 2 m in the plane."""


def add_options(command: ArgumentParser) -> None:
    """Add the options of this benchmark."""
    command.add_argument('--count', type=count, default=1000, metavar='COUNT',
                         help='places of the built-in world: a pair in each, and one with another')
    command.add_argument('--limit', type=count, default=300,
                         help='right pairs of the drives, and as many wrong ones')
    inputs.add_max_distance(command)
    inputs.add_kinds(command)


def measure(arguments: Namespace, folder: Path) -> None:
    """Register with no threshold, fit, and compare what is claimed with what is right."""
    samples = []
    for number, sample in enumerate(_samples(arguments), 1):
        samples.append(sample)
        if number % 50 == 0:
            inputs.say(f'{number} registrations, {sum(s.right for s in samples)} right')
    model = fit(samples)
    right = np.array([s.right for s in samples])
    claims = {group: left_out(samples, group) for group in ('sensor', 'place')}
    rows = []
    for group, claimed in claims.items():
        names = np.array([getattr(s, group) for s in samples])
        for name in (*np.unique(names), None):
            own = names == name if name else np.ones(len(names), bool)
            found = quality(claimed[own], right[own])
            rows.append((f'{group} {name}' if name else f'all, by {group}', str(found.samples),
                         str(found.right), f'{found.calibration_error:.3f}', f'{found.brier:.3f}',
                         f'{found.sure_wrong} of {found.sure}'))
    values = ', '.join(f'{value:.2f}' for value in model.coefficients)
    text = '\n\n'.join((
        f'intercept {model.intercept:.2f}; overlap, violations: {values}',
        markdown(['left out', 'answers', 'right', 'expected calibration error', 'Brier score',
                  'wrong of those that claim 0.99'], rows)))
    inputs.finish(arguments, folder, text, [asdict(s) for s in samples], int(right.sum()),
                  int((~right).sum()))
    plot_calibration(folder / 'calibration.png', samples, claims['sensor'])


def _samples(arguments: Namespace) -> Iterator[Sample]:
    """Yield what becomes of registrations that are neither ambiguous nor degenerate."""
    config = inputs.default_config(arguments).replace(min_confidence=0.0)
    for pair, sensor, place, labels in _pairs(arguments):
        assert pair.source is not None
        assert pair.target is not None
        own = config.replace(label_convention=pair.target.label_convention)
        found = register(pair.source.read(), pair.target.read(), own)
        if found.T_target_source is None or found.score is None:
            continue
        # what competes makes another verdict; but different places are wrong in any case
        if found.status is not Status.REGISTERED and (pair.right or sensor != place):
            continue
        yield Sample(found.score.overlap, found.score.violations,
                     _is_right(pair, found.T_target_source), sensor, place, labels)


def _is_right(pair: Pair, T_target_source: NDArray[np.float64]) -> bool:
    if not pair.right or pair.T_target_source is None:
        return False
    if rotation_error_deg(T_target_source, pair.T_target_source) > RIGHT_DEG:
        return False
    if pair.heights_known:
        return bool(translation_error_m(T_target_source, pair.T_target_source) < RIGHT_M)
    gap = T_target_source[:2, 3] - pair.T_target_source[:2, 3]
    return bool(np.linalg.norm(gap) < 2.0)


def _pairs(arguments: Namespace) -> Iterator[tuple[Pair, str, str, str]]:
    """Yield pairs, with the names of sensor, kind of place and labels."""
    rng = np.random.default_rng(arguments.seed)
    if inputs.wants_world(arguments) and arguments.count:
        from ...world.sensors import SENSORS
        kinds, sensors = list(scene_kinds(arguments.kinds or ())), list(SENSORS)
        for index in range(arguments.count):
            kind, sensor = (str(rng.choice(names)) for names in (kinds, sensors))
            labels = str(rng.choice(LABELS))
            lidar = replace(SENSORS[sensor],
                            label_noise=0.3 if labels == LABELS[2] else 0.0)
            for pair in scene_pairs(kind, 1, 100 * arguments.seed + index, lidar):
                yield _labelled(pair, labels), sensor, kind, labels
    if not arguments.data or not arguments.limit:
        return
    drives = inputs.data_drives(arguments)
    for pair in (*inputs.right_pairs(arguments, drives, arguments.limit),
                 *pairing.wrong_pairs(drives, arguments.limit, arguments.seed)):
        labels = str(rng.choice(LABELS[:2]))
        assert pair.source is not None
        yield _labelled(pair, labels), pair.source.data_set, pair.source.data_set, labels


def _labelled(pair: Pair, labels: str) -> Pair:
    """Return a pair without its labels where they are to be none."""
    if labels != LABELS[0]:
        return pair
    return replace(pair, source=_bare(pair.source), target=_bare(pair.target))


def _bare(frame: DriveScan | None) -> DriveScan | None:
    return None if frame is None else frame.without_labels()
