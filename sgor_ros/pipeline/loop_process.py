"""A process for loops, that gets what the scans leave over."""
from concurrent.futures import ProcessPoolExecutor
import ctypes
from importlib import import_module
import multiprocessing
import os
import signal

from ..core.execution.cache import choose_cache_folder

NICE = 10
"""The scans come first, and where others want the cores too there is some left for it."""
DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux."""


def loop_process() -> ProcessPoolExecutor:
    """Return an executor with one process of low priority; it starts with the first pair.

    A thread would take its turns from that of the scans.
    """
    # threads of the parent do not survive a fork
    return ProcessPoolExecutor(1, multiprocessing.get_context('spawn'), _prepare)


def end(executor: ProcessPoolExecutor) -> None:
    """End the process, whatever it is at."""
    executor.shutdown(wait=False, cancel_futures=True)
    for child in multiprocessing.active_children():
        child.kill()


def _prepare() -> None:
    """Run in the process before anything else."""
    os.nice(NICE)
    signal.signal(signal.SIGINT, signal.SIG_IGN)    # a terminal sends it to all; the node decides
    ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
    choose_cache_folder()
    # compiled code takes a second to load
    import_module('..mapping.loops.verification', __package__)
