"""Where compiled code is kept: numba reads it as it is loaded, so it is decided without numba.

Numba keeps compiled code beside the source or in the user's cache, and gives up where neither can
be written, as in a container of which only /tmp can be.
"""
import os
from pathlib import Path
import tempfile

VARIABLE = 'NUMBA_CACHE_DIR'


def choose_cache_folder() -> None:
    """Name a folder in the environment where none is named and numba would find none."""
    usual = (Path(__file__).parent,
             Path(os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')))
    if not os.environ.get(VARIABLE) and not any(map(_writable, usual)):
        os.environ[VARIABLE] = str(_private_folder())


def _writable(folder: Path) -> bool:
    """Return whether a folder can be written, or made where it is not there yet."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    return os.access(there, os.W_OK)


def _private_folder() -> Path:
    """Return a folder for temporary files of this user alone: what is in it will be run."""
    folder = Path(tempfile.gettempdir()) / f'sgor_ros_{os.getuid()}'
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    mine = found.st_uid == os.getuid() and found.st_mode & 0o777 == 0o700
    return folder if mine else Path(tempfile.mkdtemp())
