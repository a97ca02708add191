"""A process that has registered, forked: `multiprocessing`'s default on Linux."""
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow    # processes that compile anew

CODE = """
import multiprocessing
import numpy as np
from sgor_ros import preprocess, register, SemanticScan

points = np.random.default_rng(0).uniform(-30, 30, (20000, 3))
points[:8000, 2], points[8000:14000, 0], points[14000:, 1] = -2, 25, -28

def pose(_=None):
    prepared = preprocess(SemanticScan(points))
    return register(prepared, prepared).T_target_source

here = pose()
with multiprocessing.get_context('fork').Pool(1) as pool:
    for _ in range(2):
        there = pool.map_async(pose, [0]).get(timeout=10)[0]
        assert np.allclose(here, there, atol=1e-6), (here, there)
print('done')
"""


def test_a_forked_child_registers_too():
    """No thread of the parent is in the child, so whoever waits for one waits for ever."""
    done = subprocess.run([sys.executable, '-W', 'ignore', '-c', CODE], capture_output=True,
                          text=True, check=False)
    assert done.stdout == 'done\n', done.stderr[-2000:]
