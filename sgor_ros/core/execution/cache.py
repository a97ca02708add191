"""Where compiled code is kept, for processes that are ours: the node and the commands.

Numba keeps compiled code beside the source or, where that cannot be written, in the user's cache,
and gives up where neither can, as in a container of which only /tmp can be. It does not look
beside the source for what it may only read: whoever uses a package that somebody else installed
and compiled would compile everything again.

Nothing of this happens at import: a program that uses the library has numba's own behaviour,
unless it calls `choose_cache_folder`.
"""
from contextlib import suppress
import os
from pathlib import Path
import sys
import tempfile

VARIABLE = 'NUMBA_CACHE_DIR'
PACKAGE = Path(__file__).parents[2]


def choose_cache_folder() -> None:
    """Find compiled code that came with the package; name a folder where numba has none.

    To be called before the first ``from sgor_ros import ...``: each kernel looks for its folder as
    it is loaded. Sets ``NUMBA_CACHE_DIR`` where numba would give up, and copies files into the
    user's cache where the package can't be written.
    """
    if os.environ.get(VARIABLE) or _writable(PACKAGE):
        return
    user = Path(os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache'))
    if _writable(user):
        folder = user / 'numba'    # numba's own choice
    else:
        folder = _private_folder()
        os.environ[VARIABLE] = str(folder)
        if 'numba' in sys.modules:    # it has read its environment already
            from numba import config
            config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    with suppress(OSError):    # a full disk, for one: then it is compiled
        _copy_installed(folder)


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


def _copy_installed(folder: Path) -> None:
    """Copy what was compiled beside the source into a cache of numba, unless it has newer."""
    from hashlib import sha1
    from shutil import copyfile

    # the index last: it names the others
    for path in (*PACKAGE.rglob('*.nbc'), *PACKAGE.rglob('*.nbi')):
        if not (_trusted(path) and _trusted(path.parent)):
            continue
        source = path.parents[1]
        home = folder / f'{source.name}_{sha1(str(source).encode()).hexdigest()}'
        copy = home / path.name
        if copy.exists() and copy.stat().st_mtime >= path.stat().st_mtime:
            continue
        home.mkdir(parents=True, exist_ok=True)
        part = home / f'{path.name}.{os.getpid()}'
        copyfile(path, part)
        part.replace(copy)


def _trusted(path: Path) -> bool:
    """Return whether nobody but the owner of the package, whose code we run, could write this."""
    found = path.lstat()
    return found.st_uid in (0, PACKAGE.stat().st_uid) and not found.st_mode & 0o022
