"""How many cores the compiled loops may use, and the threads that share them.

Compiled kernels are serial and let go of the interpreter; what runs in parallel is calls of them
on pieces of the work. Numba's own parallel loops took three times as long to compile.
"""
from collections.abc import Callable
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count as counter
import os
import threading
from typing import Any

from .compiling import listen

PIECES = 8
"""Pieces of the work for each thread: the last one to end leaves the others idle."""

_CORES = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1
_allowed = threading.local()
_pool: list[ThreadPoolExecutor] = []
# a child has none of the threads of its parent
os.register_at_fork(after_in_child=_pool.clear)


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Let the compiled loops of this thread use up to `count` cores.

    BLAS is left alone: its limit is one for the whole process, which is not ours. What is
    large enough to wake its threads goes through `core.common.products` instead.
    """
    listen()
    before = getattr(_allowed, 'count', _CORES)
    _allowed.count = min(count, _CORES)
    try:
        yield
    finally:
        _allowed.count = before


def parallel_for(kernel: Callable[..., None], count: int, *arguments: Any) -> None:
    """Call ``kernel(first, last, *arguments)`` on pieces of ``range(count)`` that cover it.

    As many threads as `cores` allows take the pieces, each the next one that is left. The kernel
    is compiled with ``nogil`` and writes into its arguments, each piece its own part.
    """
    threads = min(getattr(_allowed, 'count', _CORES), count)
    if threads <= 1:
        if count:
            kernel(0, count, *arguments)
        return
    pieces = min(PIECES * threads, count)
    following = counter()

    def take() -> None:
        while (piece := next(following)) < pieces:
            kernel(count * piece // pieces, count * (piece + 1) // pieces, *arguments)

    if not _pool:
        _pool.append(ThreadPoolExecutor(_CORES, 'sgor'))
    others = [_pool[0].submit(take) for _ in range(threads - 1)]
    try:
        take()
    finally:
        for other in others:
            # not begun yet, where others use the pool: nothing is left for it
            if not other.cancel():
                other.result()
