"""How many cores the compiled loops may use."""
import numba

# OpenMP takes calls from several threads; numba's own pool aborts, an old TBB only warns
numba.config.THREADING_LAYER_PRIORITY = ['omp', 'tbb', 'workqueue']


def use_threads(count: int) -> None:
    """Let the compiled loops of this thread use up to `count` cores."""
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
