"""Without what the extra `evaluation` brings: commands tell what to install."""
import os
from pathlib import Path
import subprocess
import sys

import pytest

import sgor_ros


def without(code, folder, *packages):
    """Run code in a process in which some packages are not there."""
    hide = ''.join(f'sys.modules[{name!r}] = None; ' for name in packages)
    return subprocess.run(
        [sys.executable, '-c', f'import sys; {hide}\n{code}'], capture_output=True, text=True,
        cwd=folder, check=False,
        env={**os.environ, 'PYTHONPATH': str(Path(sgor_ros.__file__).parents[1])})


@pytest.mark.parametrize(('command', 'arguments'), [
    ('benchmark', ['sequence', '--scans', '2']), ('demo', ['--scans', '2'])])
def test_commands_tell_in_one_line_what_to_install(command, arguments, tmp_path):
    done = without(f'from sgor_ros.commands.{command} import main; sys.exit(main({arguments}))',
                   tmp_path, 'evo')
    assert done.returncode == 2
    told = [line for line in done.stderr.splitlines() if line.startswith('error: ')]
    assert told == ["error: the errors of trajectories need evo: pip install "
                    "'sgor_ros[evaluation]'"]
    assert 'Traceback' not in done.stderr


def test_the_library_registers_without_evaluation(tmp_path):
    done = without('import numpy as np, sgor_ros\n'
                   'points = np.random.default_rng(0).uniform(-50, 50, (300, 3))\n'
                   'found = sgor_ros.register_correspondences(points, points + (1, 2, 3))\n'
                   'print(found.T_target_source[:3, 3].round(3).tolist(),\n'
                   '      [name for name in sys.modules if name.startswith("sgor_ros.eval")])',
                   tmp_path, 'evo', 'open3d', 'matplotlib', 'rich', 'rosbags', 'igraph')
    assert done.stdout == '[1.0, 2.0, 3.0] []\n', done.stderr
