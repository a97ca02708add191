"""Tells of compiling, which numba does without a word, and can refuse it."""
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
import logging
import threading

from numba.core import event

PACKAGE = __name__.partition('.')[0]

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
        'compiling for this machine: once, it takes a quarter of a minute or so')


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
