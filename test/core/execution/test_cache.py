"""Compiled code of a package that somebody else installed: read, but never from just anybody.

By the node and the commands, which call `choose_cache_folder` before anything else.
"""
import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

import sgor_ros

pytestmark = pytest.mark.slow    # processes that compile anew

# of one small kernel: how often it is compiled
CODE = """
from numba.core import event
import numpy as np
from sgor_ros.core.execution.cache import choose_cache_folder
choose_cache_folder()
from sgor_ros.core.solver.verification import near_counts
compiled = []
class Listener(event.Listener):
    def on_start(self, event):
        compiled.append(event)
    def on_end(self, event):
        pass
event.register('numba:compile', Listener())
near_counts(np.eye(4)[None], np.zeros((2, 3)), np.zeros((2, 3)), 1.0)
print(len(compiled))
"""
RIGHTS = '-dac_override,-dac_read_search'
# root may write everywhere
ROOT = os.geteuid() == 0
MORTAL = ['setpriv', f'--bounding-set={RIGHTS}', f'--inh-caps={RIGHTS}'] if ROOT else []


def compiled(package, home, prefix=()):
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME')}
    done = subprocess.run([*prefix, sys.executable, '-c', CODE], capture_output=True, text=True,
                          cwd=home, check=True, env={
                              **environment, 'PYTHONPATH': str(package.parent), 'HOME': str(home)})
    return int(done.stdout)


@pytest.mark.skipif(ROOT and shutil.which('setpriv') is None,
                    reason='root may write everywhere')
def test_a_user_finds_what_was_compiled_at_the_installation(tmp_path):
    package = shutil.copytree(Path(sgor_ros.__file__).parent, tmp_path / 'installed/sgor_ros',
                              ignore=shutil.ignore_patterns('__pycache__'))
    homes = [tmp_path / name for name in ('installer', 'user', 'wary')]
    for home in homes:
        home.mkdir()
    assert compiled(package, homes[0]) > 0
    assert compiled(package, homes[0]) == 0
    folders = [path for path in package.rglob('*') if path.is_dir()]
    kept = list(package.rglob('*.nb[ci]'))
    assert kept
    for path in kept:
        path.chmod(0o444)
    for path in folders:
        path.chmod(0o555)
    package.chmod(0o555)
    try:
        assert compiled(package, homes[1], MORTAL) == 0
        assert compiled(package, homes[1], MORTAL) == 0
        # somebody else may have written it
        for path in kept:
            path.chmod(0o446)
        assert compiled(package, homes[2], MORTAL) > 0
    finally:
        for path in (package, *folders):
            path.chmod(0o755)
