"""Sets of matches in files, as other people's programs write them."""
from pathlib import Path

import numpy as np

from ...core.common.settings import InputError
from .pair import Matches
from .pair import Pair

TRUTH = '_T_target_source.txt'


def read_pair(folder: Path, name: str, inlier_m: float) -> Pair:
    """Return a pair of one set of matches, source and target (N, 3), with its truth.

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
    return Pair(None, None, T, name=name, group='files',
                matches=Matches.of(pairs[:, :3], pairs[:, 3:], inlier_m))
