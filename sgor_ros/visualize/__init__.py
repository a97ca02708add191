"""A look through rerun: what the tracker does of a drive, what a registration did, a map."""
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import sys
import sysconfig
from typing import TYPE_CHECKING

from ..core.common.settings import InputError
from ..core.config import SgorConfig

if TYPE_CHECKING:    # rerun is an extra
    from .known_map import MapView
    from .pair import PairView
    from .track import TrackView

VIEWER = ''
"""In place of a file: a viewer is opened."""

DISPLAYS = ('DISPLAY', 'WAYLAND_DISPLAY')


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


def map_view(target: str | Path) -> 'MapView':
    """Return what shows a map; parameter and errors as of `track_view`."""
    check(target)
    from .known_map import MapView
    return MapView(target)


def check(target: str | Path) -> None:
    """Refuse what cannot be written, before the work is done.

    Raises
    ------
    InputError
        No rerun here, no display for a viewer, a file of another kind, or a folder that is
        missing.
    """
    if find_spec('rerun') is None:
        raise InputError('--visualize needs rerun: pip install rerun-sdk')
    path = Path(target)
    if target == VIEWER:
        if sys.platform == 'linux' and not any(map(os.environ.get, DISPLAYS)):
            raise InputError(f'--visualize: no display here ({" and ".join(DISPLAYS)} are not '
                             'set); write a file by --visualize FILE.rrd, and open it where there '
                             'is one: rerun FILE.rrd')
        viewer_program()
        return
    if path.suffix != '.rrd':
        raise InputError(f'--visualize {target}: expected a name ending in .rrd, or none at all '
                         'for a viewer')
    if not path.resolve().parent.is_dir():
        raise InputError(f'--visualize {target}: no folder {path.resolve().parent}')


def viewer_program() -> str:
    """Return the path of rerun's viewer: of this interpreter, whatever PATH is, or of PATH.

    Raises
    ------
    InputError
        There is none.
    """
    for folders in (sysconfig.get_path('scripts'), str(Path(sys.executable).parent), None):
        found = shutil.which('rerun', path=folders)
        if found:
            return found
    raise InputError('--visualize: no program rerun here: pip install rerun-sdk')
