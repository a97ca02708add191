"""The setting `threads` is kept: compiled loops, GICP and BLAS."""
import time

import numba
import numpy as np
from threadpoolctl import threadpool_info

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.common.threads import cores
from sgor_ros.core.warmup import warm_up


def blas_threads():
    return [pool['num_threads'] for pool in threadpool_info()
            if pool['user_api'] == 'blas' and 'numpy' in pool['filepath']]


def test_cores_holds_numba_and_blas_and_gives_them_back():
    """Within: `count` for the loops, one for BLAS; afterwards what the caller had."""
    numba_before, blas_before = numba.get_num_threads(), blas_threads()
    with cores(1):
        assert numba.get_num_threads() == 1
        assert set(blas_threads()) <= {1}
    assert (numba.get_num_threads(), blas_threads()) == (numba_before, blas_before)


def test_one_thread_is_one_thread():
    """With threads = 1 no other thread of the process works, not even one that spins."""
    config = SgorConfig(threads=1)
    warm_up(config)
    points = np.random.default_rng(0).uniform(-30, 30, (60000, 3))
    points[:30000, 2] = -2.0
    time.sleep(0.2)    # threads of BLAS that spin from before go to sleep
    everybody, own = time.process_time(), time.thread_time()
    prepared = preprocess(SemanticScan(points), config)
    register(prepared, prepared, config)
    everybody, own = time.process_time() - everybody, time.thread_time() - own
    assert everybody < 1.2 * own
