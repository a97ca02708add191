"""Tells of compiling, which numba does without a word, can refuse it, and drops damaged caches."""
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
import logging
from pathlib import Path
import pickle
import sys
import threading

from numba.core import event

PACKAGE = __name__.partition('.')[0]

TAKES = 'about half a minute'
"""On two free cores; the pages say the same."""

_thread = threading.local()


class NotCompiledError(Exception):
    """A kernel is not in the cache."""


@cache
def listen() -> None:
    """Hear of each kernel that is compiled from now on; whoever runs kernels calls it first."""
    event.register('numba:compile', _Watch())  # type: ignore[no-untyped-call]


@contextmanager
def loading_only() -> Iterator[None]:
    """Raise `NotCompiledError` where this thread would compile a kernel, rather than do it."""
    listen()
    _thread.loads_only = True
    try:
        yield
    finally:
        _thread.loads_only = False


@cache
def tell() -> None:
    """Warn that it takes a while, once a process; where nobody logs, stderr gets it."""
    logging.getLogger(PACKAGE).warning(
        f'compiling for this machine: once, it takes {TAKES}')


def drop_damaged() -> int:
    """Remove files of numba's cache that cannot be read, and return how many they were.

    A full disk or a power cut leaves such files. Numba raises what unpickling raises, at every
    start; without them it compiles.
    """
    modules = [module for name, module in sys.modules.items() if name.startswith(f'{PACKAGE}.')]
    folders = {Path(kernel.stats.cache_path) for module in modules
               for kernel in vars(module).values() if hasattr(kernel, 'py_func')}
    damaged = [path for folder in folders for path in folder.glob('*.nb[ci]')
               if not _is_whole(path)]
    for path in damaged:
        path.unlink()
    if damaged:
        logging.getLogger(PACKAGE).warning(
            '%d files of compiled code were damaged: they are made again', len(damaged))
    return len(damaged)


def _is_whole(path: Path) -> bool:
    """Return whether a file is pickles from its start to its end, an index two, code one."""
    try:
        with path.open('rb') as file:
            for _ in range(2 if path.suffix == '.nbi' else 1):
                pickle.load(file)    # numba does the same with it
            return not file.read(1)
    except Exception:    # whatever the bytes bring about
        return False


class _Watch(event.Listener):
    """Hears of each kernel that the cache does not have."""

    def on_start(self, event: event.Event) -> None:
        # whoever else uses numba in this process is none of our business
        if event.data['dispatcher'].py_func.__module__.partition('.')[0] == PACKAGE:
            if getattr(_thread, 'loads_only', False):
                raise NotCompiledError
            tell()

    def on_end(self, event: event.Event) -> None:
        pass
