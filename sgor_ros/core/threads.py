"""How many cores the compiled loops may use, and how they wait.

Imported before numba's and small_gicp's OpenMP are loaded: they read the policy then.
"""
import os

# spinning threads slow everything down three- to fourfold when other processes need the cores
os.environ.setdefault('OMP_WAIT_POLICY', 'passive')

import numba  # noqa: E402

# OpenMP takes calls from several threads; numba's own pool aborts, an old TBB only warns
numba.config.THREADING_LAYER_PRIORITY = ['omp', 'tbb', 'workqueue']


def use_threads(count: int) -> None:
    """Let the compiled loops of this thread use up to `count` cores."""
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
