"""Matches from files, as other people's programs write them."""
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ..methods import Matches
from .task import EASY
from .task import HARD
from .task import INDOOR
from .task import MEDIUM
from .task import Protocol
from .task import Task

INDOOR_M = 0.1
TRUTH = '_T_target_source.txt'


def given_matches(folder: Path, names: str, inlier_m: float) -> Protocol:
    """Return a task for each set: ``NAME_source.txt`` and ``NAME_target.txt`` of (N, 3) points.

    Or ``NAME_source_target.txt``, (N, 6); with ``NAME_T_target_source.txt``, a 4x4 matrix.
    Thresholds are those of rooms where `inlier_m` is 0.1 or less.
    """
    indoor = inlier_m <= INDOOR_M
    tasks = list(_tasks(folder, names, inlier_m))
    if not tasks:
        raise InputError(f'{folder}: no {names}{TRUTH} in it')
    return Protocol('matches', tasks, (INDOOR,) if indoor else (EASY, MEDIUM, HARD), inlier_m,
                    SgorConfig.indoor().paper_steps() if indoor else SgorConfig.paper())


def _tasks(folder: Path, names: str, inlier_m: float) -> Iterator[Task]:
    for truth in sorted(folder.glob(names + TRUTH)):
        name = truth.name.removesuffix(TRUTH)
        both = truth.with_name(f'{name}_source_target.txt')
        try:
            pairs = (np.loadtxt(both, ndmin=2) if both.is_file() else np.hstack([np.loadtxt(
                truth.with_name(f'{name}_{end}.txt'), ndmin=2) for end in ('source', 'target')]))
            T = np.loadtxt(truth)
        except (OSError, ValueError) as error:
            raise InputError(f'{truth.with_name(name)}_*.txt: {error}') from error
        if pairs.shape[1] != 6 or T.shape != (4, 4):
            raise InputError(f'{truth.with_name(name)}_*.txt: expected points of three numbers '
                             'and a 4x4 matrix')
        yield Task(name, 'files', None, None, T, Matches.of(pairs[:, :3], pairs[:, 3:], inlier_m))
