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

import numba
from threadpoolctl import ThreadpoolController

from . import compiling as compiling  # listens from now on

PIECES = 8
"""Pieces of the work for each thread: the last one to end leaves the others idle."""

# its names are made as it is loaded, unseen by type checkers
_config: Any = numba.config
# where the package has chosen a folder after numba was loaded by somebody else
_config.CACHE_DIR = _config.CACHE_DIR or os.environ.get('NUMBA_CACHE_DIR', '')

# of numpy, which numba has loaded by now
_blas = ThreadpoolController().select(user_api='blas')

_CORES = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1
_allowed = threading.local()
_pool: list[ThreadPoolExecutor] = []
# a child has none of the threads of its parent
os.register_at_fork(after_in_child=_pool.clear)


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Let the compiled loops of this thread use up to `count` cores, and BLAS one.

    Our matrices are small, and threads of BLAS spin for tens of milliseconds after each product:
    on two cores that doubled the CPU time of a scan. BLAS has one setting for the whole process:
    where several threads are in here at once, the last to leave may leave it at one.
    """
    before = getattr(_allowed, 'count', _CORES)
    _allowed.count = min(count, _CORES)
    try:
        with _blas.limit(limits=1):
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
