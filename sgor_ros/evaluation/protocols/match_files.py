"""Matches from files, as other people's programs write them."""
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ..methods import Matches
from ..methods.interface import INDOOR_M
from ..metrics.registration_recall import EASY
from ..metrics.registration_recall import HARD
from ..metrics.registration_recall import INDOOR
from ..metrics.registration_recall import MEDIUM
from .pairs import Pair
from .protocol import Protocol

Array = NDArray[np.float64]

TRUTH = '_T_target_source.txt'


def given_matches(folder: Path, names: str, inlier_m: float) -> Protocol:
    """Return a pair for each set: ``NAME_source.txt`` and ``NAME_target.txt`` of (N, 3) points.

    Or ``NAME_source_target.txt``, (N, 6); with ``NAME_T_target_source.txt``, a 4x4 matrix.
    Thresholds are those of rooms where `inlier_m` is 0.1 or less.
    """
    indoor = inlier_m <= INDOOR_M
    pairs = list(_pairs(folder, names, inlier_m))
    if not pairs:
        raise InputError(f'{folder}: no {names}{TRUTH} in it')
    return Protocol('matches', pairs, (INDOOR,) if indoor else (EASY, MEDIUM, HARD), inlier_m,
                    SgorConfig.indoor().paper_steps() if indoor else SgorConfig.paper())


def _pairs(folder: Path, names: str, inlier_m: float) -> Iterator[Pair]:
    for path in sorted(folder.glob(names + TRUTH)):
        name = path.name.removesuffix(TRUTH)
        source, target, T = read_set(folder, name)
        yield Pair(None, None, T, name=name, group='files',
                   matches=Matches.of(source, target, inlier_m))


def read_set(folder: Path, name: str) -> tuple[Array, Array, Array]:
    """Return source and target (N, 3) and T_target_source (4, 4) of one set.

    From ``NAME_source.txt`` and ``NAME_target.txt``, or ``NAME_source_target.txt`` of six columns,
    and ``NAME_T_target_source.txt``.

    Raises
    ------
    InputError
        One of the files is missing, or is something else.
    """
    both = folder / f'{name}_source_target.txt'
    try:
        pairs = (np.loadtxt(both, ndmin=2) if both.is_file() else np.hstack([np.loadtxt(
            folder / f'{name}_{end}.txt', ndmin=2) for end in ('source', 'target')]))
        T = np.loadtxt(folder / f'{name}{TRUTH}')
    except (OSError, ValueError) as error:
        raise InputError(f'{folder / name}_*.txt: {error}') from error
    if pairs.shape[1] != 6 or T.shape != (4, 4):
        raise InputError(f'{folder / name}_*.txt: expected points of three numbers and a 4x4 '
                         'matrix')
    return pairs[:, :3], pairs[:, 3:], T
