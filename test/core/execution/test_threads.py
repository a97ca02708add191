"""The setting `threads` is kept: compiled loops, GICP and BLAS."""
from concurrent.futures import ThreadPoolExecutor
import threading
import time

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.execution import threads
from sgor_ros.core.execution.threads import cores
from sgor_ros.core.execution.threads import parallel_for
from sgor_ros.core.warmup import warm_up


def blas_threads():
    return [pool['num_threads'] for pool in threadpool_info()
            if pool['user_api'] == 'blas' and 'numpy' in pool['filepath']]


def takers(count, at_least=1):
    """Return the threads that took pieces of `count`, and how often each index was taken.

    Nobody goes on before `at_least` threads have come, however busy the machine is.
    """
    found, taken = set(), np.zeros(count, int)
    enough = threading.Event()

    def kernel(first, last):
        found.add(threading.get_ident())
        taken[first:last] += 1
        if len(found) >= at_least:
            enough.set()
        enough.wait(60.0)
    parallel_for(kernel, count)
    return found, taken


def test_cores_holds_loops_and_blas_and_gives_them_back(monkeypatch):
    """Within: `count` for the loops, one for BLAS; afterwards what the caller had."""
    monkeypatch.setattr(threads, '_CORES', 4)
    blas_before = blas_threads()
    with cores(1):
        assert takers(100)[0] == {threading.get_ident()}
        assert set(blas_threads()) <= {1}
        with cores(3):
            assert 2 <= len(takers(100, 2)[0]) <= 3
        assert takers(100)[0] == {threading.get_ident()}
    assert len(takers(100, 2)[0]) > 1
    assert blas_threads() == blas_before


@pytest.mark.parametrize('count', [0, 1, 2, 3, 17, 1000])
def test_shared_work_is_done_once(count):
    """Every index belongs to one piece, whatever the number of pieces."""
    assert np.all(takers(count)[1] == 1)


def test_an_error_in_a_piece_reaches_the_caller():
    """From whichever thread it comes; the others are none the worse for it."""
    def kernel(first, last):
        time.sleep(0.002)
        if last == 1000:
            raise MemoryError('in a piece')
    for _ in range(20):
        with pytest.raises(MemoryError, match='in a piece'):
            parallel_for(kernel, 1000)
    assert np.all(takers(1000)[1] == 1)


def test_threads_that_share_at_the_same_time():
    """More callers than the pool has threads: nobody waits for ever, nothing is left out."""
    with ThreadPoolExecutor(8) as callers:
        for _, taken in callers.map(lambda _: takers(50), range(64)):
            assert np.all(taken == 1)


@pytest.mark.slow
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
