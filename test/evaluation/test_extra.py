"""Without the extra of evaluation: the package works, and commands tell what to install."""
import subprocess
import sys

import pytest

from sgor_ros.evaluation import methods
from sgor_ros.evaluation.methods import Estimate
from sgor_ros.evaluation.methods import imported
from sgor_ros.evaluation.methods import Method

WITHOUT = """
import sys
for name in ('evo', 'matplotlib', 'igraph', 'kiss_matcher', 'distributed', 'PIL'):
    sys.modules[name] = None
"""


def without(code, cwd):
    return subprocess.run([sys.executable, '-c', WITHOUT + code], capture_output=True, text=True,
                          cwd=cwd, check=False)


@pytest.mark.parametrize(('command', 'arguments'), [
    ('benchmark', "['pairs', '--world']"), ('benchmark', "['solver', '--counts', '400']"),
    ('tables', "['strides']"), ('demo', '[]')])
def test_commands_tell_in_one_line_what_to_install(command, arguments, tmp_path):
    done = without(f'from sgor_ros.commands.{command} import main\nsys.exit(main({arguments}))',
                   tmp_path)
    assert done.returncode == 2
    assert done.stderr == ("error: evo, matplotlib: not installed; "
                           "pip install 'sgor_ros[evaluation]'\n")
    assert not list(tmp_path.iterdir())


def test_the_package_registers_without_evaluation(tmp_path):
    done = without('import numpy as np, sgor_ros\n'
                   'points = np.random.default_rng(0).uniform(-50, 50, (300, 3))\n'
                   'found = sgor_ros.register_correspondences(points, points + (1, 2, 3))\n'
                   'print(found.T_target_source[:3, 3].round(3).tolist(),\n'
                   '      any(name.startswith("sgor_ros.evaluation") for name in sys.modules))',
                   tmp_path)
    assert done.stdout.split('\n')[0] == '[1.0, 2.0, 3.0] False', done.stderr


def on_raw_scans(scans):
    return Estimate(None)


MINE = Method('mine', on_raw_scans, 'scans')


def test_a_method_of_ones_own_is_a_function_or_a_method():
    assert imported(f'{__name__}:MINE') is MINE
    found = imported(f'{__name__}:on_raw_scans')
    assert (found.name, found.run, found.takes) == (f'{__name__}:on_raw_scans', on_raw_scans,
                                                    'matches')


def test_what_methods_returned_before_is_told_by_its_new_name():
    with pytest.warns(DeprecationWarning, match='Solution is now Estimate'):
        assert methods.Solution is Estimate
    with pytest.raises(AttributeError, match='nothing'):
        _ = methods.nothing
