"""The setting `threads` is kept, and the threads of BLAS are neither woken nor limited."""
from concurrent.futures import ThreadPoolExecutor
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.execution import threads
from sgor_ros.core.execution.threads import cores
from sgor_ros.core.execution.threads import parallel_for
from sgor_ros.core.warmup import warm_up

# threads that numpy and scipy bring, and what they have run while we were at work, nanoseconds
BLAS = """
import os, sys
def threads():
    return set(os.listdir('/proc/self/task'))
def run(ids):
    return [int(open(f'/proc/self/task/{id}/schedstat').read().split()[0]) for id in ids]
before = threads()
import numpy as np, scipy.linalg
blas = threads() - before
import time
big = np.ones((800, 800))
asleep = run(blas)
busy, end = 0, time.monotonic() + 30.0    # a busy machine may finish a product without them
while busy < len(blas) and time.monotonic() < end:
    big @ big, scipy.linalg.blas.dgemm(1.0, big, big)
    busy = sum(b > a for a, b in zip(asleep, run(blas)))
print(len(blas), busy)
from sgor_ros import *
from sgor_ros.io.scans import read_scan
config = SgorConfig(threads=2)
warm_up(config)
warm_up(SgorConfig.paper())
time.sleep(0.5)    # those that spin go to sleep
asleep = run(blas)
one, other = (read_scan(f'{path}.bin', f'{path.replace("velodyne", "labels")}.label')
              for path in sys.argv[1:])
for settings in (config, SgorConfig.paper(), config.replace(max_voxels=100000, scale=0.25)):
    register(one, other, settings)
    register(SemanticScan(one.points), SemanticScan(other.points), settings)
tracker = Tracker(config)
for i in range(4):
    tracker.track((one, other)[i % 2], (i + 1) * 10**8)
rng = np.random.default_rng(0)
points = rng.uniform(-30, 30, (12000, 3))
register_correspondences(points, rng.permuted(points), config=config)
print(*np.subtract(run(blas), asleep))
"""


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


def test_cores_holds_loops_and_gives_them_back(monkeypatch):
    """Within: `count` for the loops; afterwards what the caller had."""
    monkeypatch.setattr(threads, '_CORES', 4)
    with cores(1):
        assert takers(100)[0] == {threading.get_ident()}
        with cores(3):
            assert 2 <= len(takers(100, 2)[0]) <= 3
        assert takers(100)[0] == {threading.get_ident()}
    assert len(takers(100, 2)[0]) > 1


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


def test_no_thread_of_blas_is_woken(data_folder):
    """They are there, and run for a large product; nothing that a scan needs is one."""
    scans = [data_folder / f'kitti/08/velodyne/{i:06}' for i in (0, 1)]
    # tests before may have left limits, as Dask does
    unlimited = {name: value for name, value in os.environ.items()
                 if not name.endswith('_NUM_THREADS')}
    done = subprocess.run([sys.executable, '-c', BLAS, *map(str, scans)], env=unlimited,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    there, spent = done.stdout.splitlines()
    count, busy = map(int, there.split())
    if len(os.sched_getaffinity(0)) > 1:
        assert busy == count > 0
    assert spent.split() == ['0'] * count
