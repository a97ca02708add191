"""What would be published: an sdist, the wheel made of it, and strangers who install that."""
from email.parser import HeaderParser
from importlib.metadata import Distribution
from importlib.metadata import distribution
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / 'examples'
# a room with a pillar, seen from two places
ARRAYS = """
import sys
import numpy as np
from sgor_ros import preprocess, register, SemanticScan, SgorConfig
from sgor_ros.core.scan.labels import label_convention
rng = np.random.default_rng(0)
x, y = rng.uniform(-30, 30, (2, 40000))
ground = np.stack((x, y, np.full(40000, -1.8)), 1)
boxes = [np.r_[rng.uniform(-28, 28, 2), 0] + rng.uniform(-1, 1, (700, 3)) * rng.uniform(0.5, 3, 3)
         for _ in range(25)]
points = np.concatenate((ground, *boxes))
labels = np.repeat([40, 50], [40000, 700 * 25])
c, s = np.cos(0.6), np.sin(0.6)
R, t = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([4.0, -2.0, 0.1])
source = preprocess(SemanticScan((points - t) @ R, labels))
result = register(source, SemanticScan(points, labels))
assert result.success, result.reason
assert label_convention('nuscenes').classes and label_convention('carla').classes
print(np.abs(result.T_target_source[:3] - np.c_[R, t]).max(),
      not {'yaml', 'matplotlib', 'rosbags', 'rich', 'threadpoolctl'} & set(sys.modules),
      sys.modules.get('pkg_resources'))
"""


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True,
                          **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope='module')
def built(tmp_path_factory):
    """Return the sdist and the wheel that was built from it and from nothing else."""
    folder = tmp_path_factory.mktemp('built')
    skip = shutil.ignore_patterns('.*', 'build', 'install', 'log', 'out', '__pycache__',
                                  '*.egg-info')
    source = shutil.copytree(ROOT, folder / 'sgor_ros', ignore=skip)
    run(sys.executable, '-m', 'build', '--no-isolation', '--outdir', folder / 'dist', source)
    sdist, = (folder / 'dist').glob('*.tar.gz')
    wheel, = (folder / 'dist').glob('*.whl')
    return sdist, wheel


@pytest.fixture(scope='module')
def bare(built, tmp_path_factory):
    """Return the Python of an environment with the wheel and what its metadata asks for, only.

    They are lent by this environment, so that no test depends on a network.
    """
    folder = tmp_path_factory.mktemp('bare')
    run(sys.executable, '-m', 'venv', '--without-pip', folder)
    python = folder / 'bin/python'
    run(sys.executable, '-m', 'pip', '--python', python, 'install', '--quiet', '--no-deps',
        '--no-index', built[1])
    site, = folder.glob('lib/python3.*/site-packages')
    wanted, had = ['sgor_ros'], set()
    while wanted:
        name = wanted.pop()
        found = distribution(name) if name != 'sgor_ros' else next(
            Distribution.discover(name='sgor_ros', path=[str(site)]))
        wanted += [re.match(r'[\w-]+', line)[0] for line in found.requires or ()
                   if ';' not in line and re.match(r'[\w-]+', line)[0] not in had]
        if name in had or name == 'sgor_ros':
            continue
        had.add(name)
        for top in {path.parts[0] for path in found.files if path.parts[0] not in ('..', '.')}:
            if not (site / top).exists():
                (site / top).symlink_to(found.locate_file(top))
    assert had == {'numpy', 'scipy', 'numba', 'llvmlite'}
    return python


@pytest.fixture(scope='module')
def lent(tmp_path_factory):
    """Return a folder for PYTHONPATH that lends all else that this environment has."""
    folder = tmp_path_factory.mktemp('lent')
    (folder / 'sitecustomize.py').write_text(
        f'import sys\nsys.path.append({sysconfig.get_path("purelib")!r})\n')
    return folder


def outside(python, tmp_path, *command, lent=None):
    """Run a command of the stranger's, far from the checkout."""
    environment = {name: value for name, value in os.environ.items() if name != 'PYTHONPATH'}
    if lent is not None:
        environment['PYTHONPATH'] = str(lent)
    return run(python, *command, cwd=tmp_path, env=environment)


def test_the_index_would_show_who_what_and_how(built):
    with zipfile.ZipFile(built[1]) as wheel:
        name, = (name for name in wheel.namelist() if name.endswith('.dist-info/METADATA'))
        shown = HeaderParser().parsestr(wheel.read(name).decode())
    assert shown['Name'] == 'sgor_ros'
    assert 'example.org' not in shown['Maintainer-email']
    assert shown['Description-Content-Type'] == 'text/markdown'
    assert shown.get_payload().startswith('# sgor_ros')
    assert 'Typing :: Typed' in shown.get_all('Classifier')
    assert any('arxiv.org' in url for url in shown.get_all('Project-URL'))
    assert not any('sgor' in needed for needed in shown.get_all('Requires-Dist'))


def test_the_sdist_has_what_a_build_needs_and_no_data(built):
    with tarfile.open(built[0]) as sdist:
        names = {name.partition('/')[2] for name in sdist.getnames()}
    assert {'setup.py', 'package.xml', 'LICENSE', 'README.md', 'resource/sgor_ros',
            'sgor_ros/py.typed', 'config/sgor_node.yaml'} <= names
    assert not any(name.endswith(('.bin', '.label', '.mcap', '.npz', '.nbi')) for name in names)


def test_one_version_for_all_who_ask(built, bare, tmp_path):
    version = outside(bare, tmp_path, '-c', 'from importlib.metadata import version;'
                      'print(version("sgor_ros"))').strip()
    assert [path.name.split('-')[1].removesuffix('.tar.gz') for path in built] == [version] * 2
    assert f'\n{version} (' in (ROOT / 'CHANGELOG.rst').read_text()
    assert f'\nversion: {version}\n' in (ROOT / 'CITATION.cff').read_text()


def test_a_stranger_registers_two_scans(bare, lent, tmp_path):
    where = outside(bare, tmp_path, '-c', 'import sgor_ros; print(sgor_ros.__file__)', lent=lent)
    assert Path(where).is_relative_to(bare.parents[1])
    said = outside(bare, tmp_path, EXAMPLES / 'register_two_scans.py', lent=lent)
    assert 'cm off the truth' in said
    shown = outside(bare, tmp_path, bare.with_name('sgor_register'), '--help', lent=lent)
    assert shown.startswith('usage: sgor_register')


def test_arrays_need_numpy_scipy_and_numba_only(bare, tmp_path):
    """Two scans register to a known motion; labels of any built-in convention are known."""
    said = outside(bare, tmp_path, '-c', ARRAYS).split()
    assert float(said[0]) < 0.05
    assert said[1:] == ['True', 'None']
    assert outside(bare, tmp_path, bare.with_name('sgor_warm_up')) == 'compiled\n'


@pytest.mark.parametrize('command', ['register', 'replay', 'map', 'kitti_to_bag', 'benchmark',
                                     'tables', 'demo'])
def test_a_command_without_its_packages_says_what_to_install(bare, tmp_path, command):
    done = subprocess.run([str(bare.with_name(f'sgor_{command}')), '--help'], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 2
    line, = done.stderr.splitlines()
    assert line.startswith(f'error: sgor_{command} needs ')
    assert "pip install 'sgor_ros[commands]'" in line


def strictly(python, tmp_path, *paths):
    """Check types as somebody does who has installed the wheel."""
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('PYTHONPATH', 'MYPYPATH')}
    return subprocess.run(
        [sys.executable, '-m', 'mypy', '--strict', '--ignore-missing-imports', '--cache-dir',
         str(tmp_path / 'cache'), '--python-executable', str(python), *map(str, paths)],
        capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)


def test_types_reach_those_who_use_the_package(bare, tmp_path):
    examples = shutil.copytree(EXAMPLES, tmp_path / 'examples')
    done = strictly(bare, tmp_path, *sorted(examples.glob('*.py')))
    assert done.returncode == 0, done.stdout + done.stderr
    right = tmp_path / 'right.py'
    right.write_text('import numpy as np\nfrom sgor_ros import register, Registration\n'
                     'result = register(np.zeros((9, 3)), np.zeros((9, 4)))\n'
                     'kept: Registration = result\n'
                     'if result.success:\n    print(result.T_target_source[0, 3])\n')
    done = strictly(bare, tmp_path, right)
    assert done.returncode == 0, done.stdout
    right.write_text(right.read_text().replace('if result.success', 'if result.reason'))
    assert 'not indexable' in strictly(bare, tmp_path, right).stdout
    wrong = tmp_path / 'wrong.py'
    wrong.write_text('from sgor_ros import SemanticScan, register\n'
                     'scan = SemanticScan([[0, 0, 0]])\nregister(scan, scan, 3)\n')
    done = strictly(bare, tmp_path, wrong)
    assert 'Argument 3 to "register" has incompatible type "int"' in done.stdout
