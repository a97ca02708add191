"""Matches from files, as other people's programs write them."""
from pathlib import Path

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ..metrics.registration import INDOOR
from ..pairs.files import read_pair
from ..pairs.files import TRUTH
from ..pairs.pair import INDOOR_M
from .protocol import KITTI
from .protocol import Protocol


def given_matches(folder: Path, names: str, inlier_m: float) -> Protocol:
    """Return a pair for each set: ``NAME_source.txt`` and ``NAME_target.txt`` of (N, 3) points.

    Or ``NAME_source_target.txt``, (N, 6); with ``NAME_T_target_source.txt``, a 4x4 matrix.
    Thresholds are those of rooms where `inlier_m` is 0.1 or less.
    """
    indoor = inlier_m <= INDOOR_M
    pairs = [read_pair(folder, path.name.removesuffix(TRUTH), inlier_m)
             for path in sorted(folder.glob(names + TRUTH))]
    if not pairs:
        raise InputError(f'{folder}: no {names}{TRUTH} in it')
    return Protocol('matches', pairs, (INDOOR,) if indoor else KITTI, inlier_m,
                    SgorConfig.indoor().paper_steps() if indoor else SgorConfig.paper())
