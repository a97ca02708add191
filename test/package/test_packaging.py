"""The package as users install it: by pip, and by colcon as `ros2 run` finds it."""
from importlib.metadata import entry_points
from importlib.metadata import version
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import sysconfig

from catkin_pkg.package import parse_package
import numpy as np
import pytest
import ros_helpers as ros

import sgor_ros
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.playback.domain import Domain
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = {'sgor', 'sgor_node', 'sgor_replay', 'sgor_register', 'sgor_kitti_to_bag',
            'sgor_benchmark', 'sgor_demo', 'sgor_map', 'sgor_tables', 'sgor_warm_up'}
SITE = f'lib/python3.{sys.version_info.minor}/site-packages'
# what a user's package finds out about its own tables
LABELS = ('import sgor_ros; from sgor_ros.core.scan.labels import label_convention as find;'
          'print(sgor_ros.__file__, *[len(find(n).classes) for n in '
          '("semantickitti", "semantickitti_train", "nuscenes")])')
# what a command does first: numba alone would find no folder and refuse to load our kernels
READ_ONLY = ('import sgor_ros; from sgor_ros.core.execution.cache import choose_cache_folder;'
             'choose_cache_folder(); sgor_ros.register; import numba;'
             'print(numba.config.CACHE_DIR, sgor_ros.__file__)')


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True,
                          **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope='module')
def source(tmp_path_factory):
    """Copy what the repository holds, so that builds leave nothing behind in the checkout."""
    folder = tmp_path_factory.mktemp('source') / 'sgor_ros'
    skip = shutil.ignore_patterns('.*', 'build', 'install', 'log', 'out', '__pycache__',
                                  '*.egg-info', 'test', 'docs')
    return shutil.copytree(ROOT, folder, ignore=skip)


@pytest.fixture(scope='module')
def by_pip(source, tmp_path_factory):
    prefix = tmp_path_factory.mktemp('pip')
    run(sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps', '--no-build-isolation',
        '--ignore-installed', '--prefix', prefix, source)
    return prefix


@pytest.fixture(scope='module')
def by_colcon(source, tmp_path_factory):
    """Build as a ROS user does; only the prefix of the wheels stands in for /opt/ros/jazzy."""
    folder = tmp_path_factory.mktemp('colcon')
    run(sys.executable, '-m', 'colcon', '--log-base', folder / 'log', 'build', '--base-paths',
        source, '--build-base', folder / 'build', '--install-base', folder / 'install',
        env={'AMENT_PREFIX_PATH': sys.prefix, **os.environ})
    return folder / 'install'


def sourced(install, *command):
    """Return a command line that runs a command as after `. install/setup.bash`."""
    return ['bash', '-c', '. "$0" && exec "$@"', str(install / 'setup.bash'),
            *map(str, command)]


def test_package_xml_and_setup_agree():
    package = parse_package(str(ROOT / 'package.xml'))
    name, number, licence, mail = run(
        sys.executable, 'setup.py', '--quiet', '--name', '--version', '--license',
        '--maintainer-email', cwd=ROOT).split()
    assert (package.name, package.version, package.licenses) == (name, number, [licence])
    # colcon takes the package for one of plain Python where the address is no address
    assert [person.email for person in package.maintainers] == [mail]
    assert package.get_build_type() == 'ament_python'


def test_all_commands_exist():
    installed = {e.name: e for e in entry_points(group='console_scripts')
                 if e.value.startswith('sgor_ros.')}
    assert set(installed) == COMMANDS
    for command in installed.values():
        assert callable(command.load())


def test_the_package_knows_its_version():
    assert sgor_ros.__version__ == version('sgor_ros')


def test_pip_installs_the_marker_of_types(by_pip):
    assert (by_pip / SITE / 'sgor_ros/py.typed').is_file()


def test_pip_installs_commands_and_label_tables(by_pip):
    assert {path.name for path in (by_pip / 'bin').iterdir()} == COMMANDS
    environment = {**os.environ, 'PYTHONPATH': str(by_pip / SITE)}
    home, *counts = run(sys.executable, '-c', LABELS, env=environment, cwd=by_pip).split()
    assert Path(home).is_relative_to(by_pip)
    assert all(int(count) > 10 for count in counts)
    shown = run(by_pip / 'bin/sgor_register', '--help', env=environment, cwd=by_pip)
    assert shown.startswith('usage: sgor_register')


def test_colcon_installs_what_ros2_run_and_launch_look_for(by_colcon):
    prefix = by_colcon / 'sgor_ros'
    assert {path.name for path in (prefix / 'lib/sgor_ros').iterdir()} >= COMMANDS
    assert (prefix / 'share/ament_index/resource_index/packages/sgor_ros').is_file()
    share = prefix / 'share/sgor_ros'
    for folder, pattern in (('.', 'package.xml'), ('config', '*.yaml'), ('config', '*.rviz'),
                            ('config', '*.json'), ('launch', '*.py')):
        expected = {path.name for path in (ROOT / folder).glob(pattern)}
        assert expected, f'nothing to install from {folder}'
        assert expected <= {path.name for path in (share / folder).iterdir()}


def test_colcon_package_finds_its_own_tables(by_colcon):
    home, *counts = run(*sourced(by_colcon, sys.executable, '-c', LABELS), cwd=by_colcon).split()
    assert Path(home).is_relative_to(by_colcon)
    assert all(int(count) > 10 for count in counts)


@pytest.mark.skipif(os.geteuid() == 0 and shutil.which('setpriv') is None,
                    reason='root may write everywhere')
def test_a_read_only_install_of_a_user_without_a_home(source, tmp_path):
    package = shutil.copytree(source / 'sgor_ros', tmp_path / 'ro/sgor_ros')
    for path in (*package.rglob('*'), package, package.parent):
        path.chmod(0o555 if path.is_dir() else 0o444)
    rights = '-dac_override,-dac_read_search'
    mortal = ['setpriv', f'--bounding-set={rights}', f'--inh-caps={rights}']
    cache, home = run(
        *(mortal if os.geteuid() == 0 else []), sys.executable, '-c',
        READ_ONLY,
        env={**os.environ, 'PYTHONPATH': str(package.parent), 'HOME': str(package / 'home'),
             'TMPDIR': str(tmp_path), 'XDG_CACHE_HOME': ''}, cwd=tmp_path).split()
    for folder in (package, package.parent):
        folder.chmod(0o755)
    assert Path(home).parent == package
    assert Path(cache).parent == tmp_path
    assert Path(cache).stat().st_mode & 0o777 == 0o700


def test_node_out_of_install_tracks_and_ends_on_interrupt(by_colcon, tmp_path):
    domain = Domain()
    environment = {**domain.environment(), 'PYTHONPATH': ''}
    parameters = by_colcon / 'sgor_ros/share/sgor_ros/config/sgor_node.yaml'
    with open(tmp_path / 'log', 'w') as log:
        node = subprocess.Popen(
            sourced(by_colcon, by_colcon / 'sgor_ros/lib/sgor_ros/sgor_node', '--ros-args',
                    '--params-file', parameters),
            stdout=log, stderr=subprocess.STDOUT, env=environment, cwd=tmp_path)
    partner = ros.Partner(domain)
    try:
        partner.wait_for_node(lambda: node.poll() is None)
        truth = {}
        for seconds, points, labels, pose in simulate(2, lidar=Lidar(beams=32, columns=600)):
            stamp_ns = round(1e9 * (1 + seconds))
            partner.send(stamp_ns, ros.cloud(points, labels, stamp_ns))
            truth[stamp_ns] = pose
            partner.spin_until(lambda: len(partner.odometry) == len(truth), 60.0, 'odometry')
        first, second = truth.values()
        metres, radians = ros.difference(matrix_of(partner.odometry[-1].pose.pose),
                                         np.linalg.inv(first) @ second)
        assert metres < 0.1
        assert radians < 0.01
        node.send_signal(signal.SIGINT)
        assert node.wait(30) == 0, (tmp_path / 'log').read_text()
    finally:
        node.kill()
        partner.close()
        domain.close()


def test_an_editable_install_is_a_path_that_type_checkers_find(source, tmp_path):
    """With the options of scripts/setup.sh, by both that may install there."""
    setup = (ROOT / 'scripts/setup.sh').read_text()
    options = re.search(r'^editable=\((.*)\)$', setup, re.MULTILINE)[1].split()
    (tmp_path / 'use.py').write_text('from sgor_ros import SgorConfig\nSgorConfig(3)\n')
    venvs = {name: tmp_path / name for name in ('pip', 'uv')}
    installers = {'pip': [sys.executable, '-m', 'pip', '--python', venvs['pip'] / 'bin/python',
                          'install'],
                  'uv': [Path(sys.executable).with_name('uv'), 'pip', 'install', '--python',
                         venvs['uv'] / 'bin/python']}
    if not installers['uv'][0].is_file():
        del installers['uv']
    for name, installer in installers.items():
        python = venvs[name] / 'bin/python'
        run(sys.executable, '-m', 'venv', '--without-pip', venvs[name])
        site, = venvs[name].glob('lib/python3.*/site-packages')
        (site / 'lent.pth').write_text(sysconfig.get_path('purelib') + '\n')
        run(*installer, '--quiet', '--no-deps', '--no-build-isolation', *options, source)
        done = subprocess.run(
            [sys.executable, '-m', 'mypy', '--strict', '--ignore-missing-imports', '--cache-dir',
             str(tmp_path / 'cache'), '--python-executable', str(python), 'use.py'], cwd=tmp_path,
            capture_output=True, text=True, check=False, env={
                name: value for name, value in os.environ.items()
                if name not in ('PYTHONPATH', 'MYPYPATH')})
        assert 'has incompatible type "int"' in done.stdout or 'Too many positional' in done.stdout
