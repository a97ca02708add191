"""How many cores the compiled loops may use."""
import numba


def use_threads(count: int) -> None:
    """Let the compiled loops of this thread use up to `count` cores."""
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
