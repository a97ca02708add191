"""How results get to the disk: written beside their place, moved there once they are complete.

So whoever finds a result finds a whole one, whatever ended the run: a full disk, an error, a kill.
Folders are never mixed into or replaced, as ROS users know it of `ros2 bag record`, but for a map,
which is saved again and again; a file is named by the user each time, and replaces the one before
it.
"""
from collections.abc import Iterator
from contextlib import contextmanager
import ctypes
import fcntl
from itertools import count
import os
from pathlib import Path
import shutil

from ..core.common.settings import InputError

UNFINISHED = '.unfinished'
AT_FDCWD, RENAME_EXCHANGE = -100, 2
"""Of renameat2, which Python has no name for."""

STDOUT = Path('-')
"""As other commands call it; where that is not meant, no file gets this name."""


@contextmanager
def new_file(path: str | Path) -> Iterator[Path]:
    """Yield where to write a file that becomes `path` at the end of the ``with``.

    The name keeps its ending, which tells writers of pictures the format.
    """
    path = Path(path)
    if _is_special(path):
        yield path
        return
    beside = path.with_name(f'{path.stem}{UNFINISHED}{path.suffix}')
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def new_folder(path: str | Path, part: bool = False) -> Iterator[Path]:
    """Yield where to make a folder that becomes `path` at the end of the ``with``.

    That place has the name of `path`, for some formats repeat it inside, and lies in a folder
    that is cleared when the ``with`` ends or, after a kill, by the next run. With `part` what was
    made becomes `path` too where the ``with`` ends by an exception.

    Raises
    ------
    InputError
        `path` exists, cannot be made, or is being written by another process.
    """
    path = Path(path)
    refuse_existing(path)
    with _place_beside(path) as place:
        try:
            yield place
        except BaseException:
            if part and place.is_dir():
                place.rename(path)
            raise
        place.rename(path)


@contextmanager
def replaced_folder(path: Path) -> Iterator[Path]:
    """Yield where to make a folder that takes the place of `path` at the end of the ``with``.

    As `new_folder`, but for one that is there, which is exchanged for the new one at once and then
    cleared. Where the file system cannot exchange, the old one waits in the folder beside for as
    long as nothing is at `path`, and the next run puts it back.

    Raises
    ------
    InputError
        `path` cannot be made, or is being written by another process.
    """
    path = path.resolve()    # a link stays, and what it leads to is replaced
    with _place_beside(path) as place:
        old = place.with_name(f'{path.name}.old')
        if old.exists() and not path.exists():
            old.rename(path)
        yield place
        _to_disk(place)
        if not path.exists():
            place.rename(path)
        elif not _exchange(place, path):
            path.rename(old)
            try:
                place.rename(path)
            except OSError:
                old.rename(path)
                raise


def _to_disk(folder: Path) -> None:
    """Wait until a folder would outlive a loss of power."""
    for path in (*folder.rglob('*'), folder):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders in one step; return whether that was possible."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:    # a C library without it
        return False
    return int(rename(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other),
                      RENAME_EXCHANGE)) == 0


@contextmanager
def _place_beside(path: Path) -> Iterator[Path]:
    """Yield where a folder is made, in one of its own that is locked, and cleared at the end."""
    beside = _beside(path)
    try:
        beside.mkdir(parents=True, exist_ok=True)
        handle = os.open(beside, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise InputError(f'{path}: cannot be made: {error.strerror}') from error
    try:
        if not _lock(handle):
            raise InputError(f'{path}: another process is writing it now')
        place = beside / path.name
        shutil.rmtree(place, ignore_errors=True)
        try:
            yield place
        finally:
            shutil.rmtree(beside, ignore_errors=True)
    finally:
        os.close(handle)


def free_folder(path: Path) -> Path:
    """Return `path`, or with a number at its end if there is or will be one: NAME_2, NAME_3."""
    names = (path if i == 1 else path.with_name(f'{path.name}_{i}') for i in count(1))
    return next(name for name in names if not os.path.lexists(name) and not _busy(name))


def refuse_existing(path: Path) -> None:
    """Raise InputError where `path` is there: nothing is mixed into it."""
    if path == STDOUT:
        raise InputError('-: a folder is written, which standard output cannot take')
    if os.path.lexists(path):
        raise InputError(f'{path}: exists already, and is neither replaced nor added to')


def check_file(path: Path, what: str, endings: tuple[str, ...] = ()) -> None:
    """Raise InputError where a file cannot be written; before the work, not after it.

    Parameters
    ----------
    path : Path
    what : str
        The option, for the message.
    endings : tuple of str
        Those that are possible; empty for any.
    """
    if endings and path.suffix.lower() not in endings:
        raise InputError(f'{what} {path}: expected a name ending in {", ".join(endings)}')
    if path == STDOUT:
        raise InputError(f'{what} -: standard output is not possible here')
    if not path.parent.is_dir():
        raise InputError(f'{what} {path}: no folder {path.parent}')
    if path.is_dir():
        raise InputError(f'{what} {path}: is a folder')
    written = path if _is_special(path) else path.parent
    if not os.access(written, os.W_OK):
        raise InputError(f'{what} {path}: no right to write {written}')


def _is_special(path: Path) -> bool:
    """Return whether a file is a device, a pipe or a link, such as /dev/stdout: not to replace."""
    return path.is_symlink() or (path.exists() and not path.is_file())


def _beside(path: Path) -> Path:
    return path.with_name(path.name + UNFINISHED)


def _busy(path: Path) -> bool:
    """Return whether a process is writing this folder now."""
    try:
        handle = os.open(_beside(path), os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return False
    try:
        return not _lock(handle)
    finally:
        os.close(handle)


def _lock(handle: int) -> bool:
    """Take the lock of a folder, which ends with the process; return whether it was free."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass    # some network file systems know no locks
    return True
