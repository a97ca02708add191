"""How many cores the compiled loops may use, and how they wait.

Imported before numba's and small_gicp's OpenMP are loaded: they read the policy then.
"""
from collections.abc import Iterator
from contextlib import contextmanager
import os
from typing import Any

# spinning threads slow everything down three- to fourfold when other processes need the cores
os.environ.setdefault('OMP_WAIT_POLICY', 'passive')

import numba
from threadpoolctl import ThreadpoolController

from .compiling import tell_of_compiling

tell_of_compiling()
# its names are made as it is loaded, unseen by type checkers
_config: Any = numba.config
# OpenMP takes calls from several threads; numba's own pool aborts, an old TBB only warns
_config.THREADING_LAYER_PRIORITY = ['omp', 'tbb', 'workqueue']
# where the package has chosen a folder after numba was loaded by somebody else
_config.CACHE_DIR = _config.CACHE_DIR or os.environ.get('NUMBA_CACHE_DIR', '')

# of numpy, which numba has loaded by now
_blas = ThreadpoolController().select(user_api='blas')


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Let the compiled loops of this thread use up to `count` cores, and BLAS one.

    Our matrices are small, and threads of BLAS spin for tens of milliseconds after each product:
    on two cores that doubled the CPU time of a scan. BLAS has one setting for the whole process:
    where several threads are in here at once, the last to leave may leave it at one.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(min(count, _config.NUMBA_NUM_THREADS))
    try:
        with _blas.limit(limits=1):
            yield
    finally:
        numba.set_num_threads(before)
