"""A live look, through rerun: what the tracker does of a drive, what a registration did."""
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.common.settings import InputError
from ..core.config import SgorConfig

if TYPE_CHECKING:    # rerun is an extra
    from .pair import PairView
    from .track import TrackView

VIEWER = ''
"""In place of a file: a viewer is opened."""


def track_view(target: str | Path, config: SgorConfig) -> 'TrackView':
    """Return what shows a drive, scan by scan.

    Parameters
    ----------
    target : str or Path
        An ``.rrd`` to write, or `VIEWER`.
    config : SgorConfig
        Its label convention gives the colours, its `min_confidence` is drawn.

    Raises
    ------
    InputError
        No rerun here, or a file that cannot be written.
    """
    check(target)
    from .track import TrackView
    return TrackView(target, config)


def pair_view(target: str | Path, config: SgorConfig) -> 'PairView':
    """Return what shows a registration; parameters and errors as of `track_view`."""
    check(target)
    from .pair import PairView
    return PairView(target, config)


def check(target: str | Path) -> None:
    """Refuse what cannot be written, before the work is done.

    Raises
    ------
    InputError
        No rerun here, a file of another kind, or a folder that is missing.
    """
    if find_spec('rerun') is None:
        raise InputError('--visualize needs rerun: pip install rerun-sdk')
    path = Path(target)
    if target == VIEWER:
        return
    if path.suffix != '.rrd':
        raise InputError(f'--visualize {target}: expected a name ending in .rrd, or none at all '
                         'for a viewer')
    if not path.resolve().parent.is_dir():
        raise InputError(f'--visualize {target}: no folder {path.resolve().parent}')
