"""What would be published: an sdist, the wheel made of it, and strangers who install that."""
from email.parser import HeaderParser
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / 'examples'


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
def stranger(built, tmp_path_factory):
    """Return the Python of an environment that has the wheel and its dependencies only.

    They are lent by this environment, so that no test depends on a network.
    """
    folder = tmp_path_factory.mktemp('stranger')
    run(sys.executable, '-m', 'venv', '--without-pip', folder)
    python = folder / 'bin/python'
    run(sys.executable, '-m', 'pip', '--python', python, 'install', '--quiet', '--no-deps',
        '--no-index', built[1])
    site, = folder.glob('lib/python3.*/site-packages')
    (site / 'lent.pth').write_text(sysconfig.get_path('purelib') + '\n')
    return python


def outside(python, tmp_path, *command):
    """Run a command of the stranger's, far from the checkout."""
    environment = {name: value for name, value in os.environ.items() if name != 'PYTHONPATH'}
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


def test_one_version_for_all_who_ask(built, stranger, tmp_path):
    version = outside(stranger, tmp_path, '-c', 'from importlib.metadata import version;'
                      'print(version("sgor_ros"))').strip()
    assert [path.name.split('-')[1].removesuffix('.tar.gz') for path in built] == [version] * 2
    assert f'\n{version} (' in (ROOT / 'CHANGELOG.rst').read_text()
    assert f'\nversion: {version}\n' in (ROOT / 'CITATION.cff').read_text()


def test_a_stranger_registers_two_scans(stranger, tmp_path):
    where = outside(stranger, tmp_path, '-c', 'import sgor_ros; print(sgor_ros.__file__)')
    assert Path(where).is_relative_to(stranger.parents[1])
    said = outside(stranger, tmp_path, EXAMPLES / 'register_two_scans.py')
    assert 'cm off the truth' in said
    shown = outside(stranger, tmp_path, stranger.with_name('sgor_register'), '--help')
    assert shown.startswith('usage: sgor_register')


def strictly(python, tmp_path, *paths):
    """Check types as somebody does who has installed the wheel."""
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('PYTHONPATH', 'MYPYPATH')}
    return subprocess.run(
        [sys.executable, '-m', 'mypy', '--strict', '--ignore-missing-imports', '--cache-dir',
         str(tmp_path / 'cache'), '--python-executable', str(python), *map(str, paths)],
        capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)


def test_types_reach_those_who_use_the_package(stranger, tmp_path):
    examples = shutil.copytree(EXAMPLES, tmp_path / 'examples')
    done = strictly(stranger, tmp_path, *sorted(examples.glob('*.py')))
    assert done.returncode == 0, done.stdout + done.stderr
    wrong = tmp_path / 'wrong.py'
    wrong.write_text('from sgor_ros import SemanticScan, register\n'
                     'scan = SemanticScan([[0, 0, 0]])\nregister(scan, scan, 3)\n')
    done = strictly(stranger, tmp_path, wrong)
    assert 'Argument 3 to "register" has incompatible type "int"' in done.stdout
