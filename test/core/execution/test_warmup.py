"""Compiling: by other processes, told once, and over when whoever asked for it is."""
import os
from pathlib import Path
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.slow    # processes that compile anew

WORD = 'compiling for this machine'
WARM_UP = """
from numba.core import event
here = []
class Listener(event.Listener):
    def on_start(self, event):
        here.append(event.data['dispatcher'].py_func.__name__)
    def on_end(self, event):
        pass
from sgor_ros import preprocess, register, SemanticScan, warm_up
from sgor_ros.core.warmup import compiled
before = compiled()
event.register('numba:compile', Listener())
warm_up()
import numpy as np
points = np.random.default_rng(0).uniform(-30, 30, (20000, 3))
points[:8000, 2], points[8000:14000, 0], points[14000:, 1] = -2, 25, -28
prepared = preprocess(SemanticScan(points))
register(prepared, prepared)
print(before, compiled(), here)
"""
MATCHES = """
import numpy as np
from sgor_ros import register_correspondences
points = np.random.default_rng(0).uniform(-30, 30, (50, 3))
print(register_correspondences(points, points).success)
"""


@pytest.fixture(scope='module')
def fresh(tmp_path_factory):
    """Return an environment in which nothing is compiled yet."""
    return {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path_factory.mktemp('cache'))}


def run(code, environment):
    return subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=True, env=environment)


def test_children_end_with_their_parent(fresh):
    """Even when it is killed: nobody compiles on for somebody who is gone."""
    parent = subprocess.Popen([sys.executable, '-c', 'import sgor_ros; sgor_ros.warm_up()'],
                              stderr=subprocess.PIPE, text=True, env=fresh)
    try:
        assert WORD in parent.stderr.readline()
        listed = Path(f'/proc/{parent.pid}/task/{parent.pid}/children')
        while len(children := listed.read_text().split()) < 2:
            assert parent.poll() is None
            time.sleep(0.02)
    finally:
        parent.kill()
        parent.wait()
    deadline = time.monotonic() + 60
    while any(Path(f'/proc/{child}/exe').exists() for child in children):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_first_call_of_the_library_says_that_it_compiles(fresh):
    """Without a word to a logger by whoever calls it."""
    done = run(MATCHES, fresh)
    assert done.stdout == 'True\n'
    assert done.stderr.count(WORD) == 1


def test_warm_up_compiles_everything_elsewhere(fresh):
    """The process that asks only loads, also for a scan of another size."""
    done = run(WARM_UP, fresh)
    assert done.stdout == 'False True []\n'
    assert done.stderr.count(WORD) == 1
    assert run(WARM_UP, fresh).stdout == 'True True []\n'


@pytest.mark.parametrize('damage', ['cut', 'emptied', 'zeroed'])
def test_a_damaged_cache_is_made_again(fresh, damage):
    """As a full disk or a power cut leaves it; once, and the rest stays as it is."""
    folder = Path(fresh['NUMBA_CACHE_DIR'])
    chosen = [next(path for path in sorted(folder.rglob(ending)) if name in path.name)
              for ending, name in (('*.nbi', '_icp'), ('*.nbc', '_judge'))]
    whole = [path.read_bytes() for path in chosen]
    other = next(path for path in sorted(folder.rglob('*.nbc'))
                 if path.parent not in [one.parent for one in chosen])
    before = other.stat().st_mtime_ns
    for path, content in zip(chosen, whole, strict=True):
        path.write_bytes({'cut': content[:len(content) // 2], 'emptied': b'',
                          'zeroed': bytes(len(content))}[damage])
    done = run(WARM_UP, fresh)
    assert done.stdout == 'False True []\n'
    assert '2 files of compiled code were damaged: they are made again' in done.stderr
    for path, content in zip(chosen, whole, strict=True):
        assert len(path.read_bytes()) == pytest.approx(len(content), rel=0.02)
    assert other.stat().st_mtime_ns == before
    assert run(WARM_UP, fresh).stdout == 'True True []\n'
