"""Matches from files, as other people's programs write them."""
from collections.abc import Iterator
from pathlib import Path

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ..methods import Matches
from ..methods.files import read_set
from ..methods.files import TRUTH
from ..methods.problem import INDOOR_M
from .task import EASY
from .task import HARD
from .task import INDOOR
from .task import MEDIUM
from .task import Protocol
from .task import Task


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
    for path in sorted(folder.glob(names + TRUTH)):
        name = path.name.removesuffix(TRUTH)
        source, target, T = read_set(folder, name)
        yield Task(name, 'files', None, None, T, Matches.of(source, target, inlier_m))
