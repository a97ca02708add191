"""Importing the library changes nothing in the process; its names are seen before they load."""
import os
from pathlib import Path
import re
import subprocess
import sys

import sgor_ros

ROOT = Path(sgor_ros.__file__).parents[1]
UNCHANGED = """
import os, sys
import numba, numpy
from numba.core import event
environment, config = dict(os.environ), vars(numba.config).copy()
listeners = {kind: list(heard) for kind, heard in event._registered.items()}
import sgor_ros
from sgor_ros import *
import sgor_ros.core.warmup
assert dict(os.environ) == environment
assert {name for name, value in vars(numba.config).items() if config.get(name) != value} == set()
assert {kind: list(heard) for kind, heard in event._registered.items() if heard} == {
    kind: heard for kind, heard in listeners.items() if heard}
"""


def run(code, **options):
    return subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          check=False, **options)


def test_import_changes_nothing(tmp_path):
    """Neither environment nor numba; and no file is written, where none was compiled before."""
    home = tmp_path / 'home'
    home.mkdir()
    done = run(UNCHANGED, cwd=ROOT, env={**os.environ, 'HOME': str(home), 'TMPDIR': str(tmp_path),
                                         'PYTHONDONTWRITEBYTECODE': '1'})
    assert done.returncode == 0, done.stderr
    assert [path for path in tmp_path.rglob('*') if path != home] == []


def test_names_are_seen_before_they_are_loaded():
    """By completion and by `help`; the docstring tells all of them and no others."""
    assert set(sgor_ros.__all__) < set(dir(sgor_ros))
    told = set(re.findall(r'`(\w+)`', sgor_ros.__doc__))
    assert told == set(sgor_ros.__all__)
    done = run('help("sgor_ros")', cwd=ROOT)
    assert 'register(source: ' in done.stdout
    assert 'class SgorConfig(' in done.stdout


def test_help_and_completion_show_the_interface():
    """And nothing else that begins with a letter but rooms that are loaded."""
    done = run('import sgor_ros; print(*dir(sgor_ros)); print(sgor_ros.__doc__)')
    names, text = done.stdout.split('\n', 1)
    assert set(sgor_ros.__all__) <= set(names.split())
    assert not {'Any', 'TYPE_CHECKING', 'DATASETS', 'ModuleType'} & set(names.split())
    for call in ('preprocess(', 'register(', 'Tracker().track(', 'open_drive(', '.transform('):
        assert call in text
