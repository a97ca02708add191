"""What all commands have in common: help, version, exit codes, and words in time."""
from argparse import Namespace
from contextlib import suppress
from importlib import import_module
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from sgor_ros import MapperConfig
from sgor_ros import SgorConfig
from sgor_ros import TrackerConfig
from sgor_ros import warm_up
from sgor_ros.commands.command_line import AGAIN_S
from sgor_ros.commands.command_line import CODES
from sgor_ros.commands.command_line import run
from sgor_ros.io.stream_config import StreamConfig

MODULES = {'sgor_register': 'commands.register', 'sgor_replay': 'commands.replay',
           'sgor_kitti_to_bag': 'commands.kitti_to_bag', 'sgor_benchmark': 'commands.benchmark',
           'sgor_map': 'commands.map', 'sgor_demo': 'commands.demo',
           'sgor_tables': 'commands.tables', 'sgor_warm_up': 'commands.warm_up',
           'sgor_node': 'ros.main'}
COMMANDS = [(name,) for name in MODULES if name != 'sgor_node'] + [
    ('sgor_benchmark', kind) for kind in ('pairs', 'wrong', 'ablation', 'sequence', 'solver')] + [
    ('sgor_map', kind) for kind in ('build', 'locate', 'merge', 'export', 'show')]
WITHOUT_ROS = 'import sys; sys.modules["rclpy"] = None; from sgor_ros.{} import main; ' \
    'sys.exit(main())'


def line(name, *arguments):
    return [sys.executable, '-m', f'sgor_ros.{MODULES[name]}', *map(str, arguments)]


def ran(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


@pytest.fixture(scope='module')
def pair(street, tmp_path_factory):
    # so that commands say nothing of compiling
    warm_up()
    folder = tmp_path_factory.mktemp('pair')
    for name, (points, labels, _) in (('source', street[1]), ('target', street[0])):
        np.savez(folder / f'{name}.npz', points=points, labels=labels)
    return folder / 'source.npz', folder / 'target.npz'


def ended(name, *arguments):
    """Run a command here, which is quicker, and return the code that it ends with."""
    with pytest.raises(SystemExit) as end:
        import_module(f'sgor_ros.{MODULES[name]}').main(list(arguments))
    return end.value.code


@pytest.mark.parametrize('command', COMMANDS, ids=' '.join)
def test_help_and_version(command, capsys):
    assert ended(*command, '--help') == 0
    said = capsys.readouterr().out
    assert said.startswith(f'usage: {" ".join(command)} ')
    assert 'default: None' not in said
    assert 'default: False' not in said
    assert f'examples:\n  {command[0]}' in said
    codes = said.partition('exit codes:')[2]
    assert all(f'  {int(code):<4} {meaning}' in codes for code, meaning in CODES.items())
    assert ended(*command, '--version') == 0
    assert capsys.readouterr().out.startswith('sgor_ros 0.')


def test_defaults_that_say_something_are_told(capsys):
    ended('sgor_benchmark', 'solver', '--help')
    said = ' '.join(capsys.readouterr().out.split())
    assert 'chooses pairs, turns and noise (default: 0)' in said
    assert 'of made-up matches (default: 0.02)' in said


@pytest.mark.parametrize(('command', 'config'), [
    (('sgor_register',), [SgorConfig]), (('sgor_tables',), []),
    *((each, [SgorConfig, TrackerConfig, MapperConfig, StreamConfig])
      for each in (('sgor_replay',), ('sgor_map', 'build')))], ids=str)
def test_help_is_short_and_help_all_tells_the_rest(command, config, capsys):
    assert ended(*command, '--help') == 0
    short = capsys.readouterr().out
    assert ended(*command, '--help-all') == 0
    full = capsys.readouterr().out
    assert len(short.splitlines()) < 90
    told = {each: set(re.findall(r'--[\w-]+', text.partition('examples:')[0]))
            for each, text in (('short', short), ('full', full))}
    assert told['short'] < told['full']
    for item in (item for each in config for item in each.settings()):
        option = f'--{item.name.replace("_", "-")}'
        assert option in told['full']
        assert (option in told['short']) == item.common


@pytest.mark.parametrize(('short', 'option', 'commands'), [
    ('-o', '--output', ['sgor_replay', 'sgor_tables', 'sgor_demo', 'sgor_benchmark pairs',
                        'sgor_map build', 'sgor_map merge', 'sgor_map show']),
    ('-v', '--visualize', ['sgor_replay', 'sgor_register']),
    ('-t', '--topic', ['sgor_replay', 'sgor_map build']),
    ('-j', '--json', ['sgor_register', 'sgor_map locate']),
    ('-p', '--plot', ['sgor_register']),
    ('-V', '--version', [' '.join(command) for command in COMMANDS])])
def test_short_options(short, option, commands, capsys):
    for command in commands:
        assert ended(*command.split(), '--help') == 0
        assert re.search(rf'{short}\b.*, {option}\b', capsys.readouterr().out), command


SGOR = [sys.executable, '-c',
        'import sys; from sgor_ros.commands.entry import sgor; sys.exit(sgor())']


def test_sgor_is_all_commands(pair):
    said = ran(*SGOR, '--help')
    assert said.returncode == 0
    listed = set(re.findall(r'^    ([\w-]+)', said.stdout, re.MULTILINE))
    assert {f'sgor_{name.replace("-", "_")}' for name in listed} == set(MODULES)
    for name in listed:
        said = ran(*SGOR, name, '--help')
        assert said.returncode == 0, said.stderr
        assert said.stdout.startswith(f'usage: sgor_{name.replace("-", "_")} ')
    by_old_name = ran(*line('sgor_register', *pair, '--json', '-'))
    said = ran(*SGOR, 'register', *map(str, pair), '-j', '-')
    assert said.returncode == 0
    one, other = (json.loads(each.stdout)['T_target_source'] for each in (said, by_old_name))
    assert one == other
    assert ran(*SGOR, 'kitti_to_bag').stderr.endswith(
        'usage: sgor_kitti_to_bag SEQUENCE OUT [options]; sgor_kitti_to_bag --help tells more\n')


def test_sgor_answers_a_slip_and_loads_no_command_for_its_help():
    said = ran(*SGOR, 'nonsense')
    assert said.returncode == 2
    assert said.stderr.startswith("error: argument COMMAND: invalid choice: 'nonsense'")
    assert ran(*SGOR).returncode == 2
    loaded = ran(sys.executable, '-c', 'import sys\nfrom sgor_ros.commands.entry import sgor\n'
                 'sys.argv[1:] = ["--help"]\ntry: sgor()\n'
                 'except SystemExit: print("scipy" in sys.modules, "numba" in sys.modules)')
    assert loaded.stdout.endswith('\nFalse False\n')


@pytest.mark.parametrize('command', COMMANDS, ids=' '.join)
def test_a_slip_is_answered_in_two_lines(command, capsys):
    assert ended(*command, '--nonsense') == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith('error: ')
    assert second.startswith(f'usage: {command[0]} ')
    assert '--help' in second


@pytest.mark.parametrize('module', ['ros.main', 'commands.demo'])
def test_without_ros(module):
    for option in ('--help', '--version'):
        said = ran(sys.executable, '-c', WITHOUT_ROS.format(module), option)
        assert (said.returncode, said.stderr) == (0, '')
        assert 'sgor_' in said.stdout
    said = ran(sys.executable, '-c', WITHOUT_ROS.format(module))
    assert said.returncode == 2
    assert said.stderr.startswith('error: no ROS 2 here')
    assert len(said.stderr.splitlines()) == 1


@pytest.mark.parametrize('name', ['sgor_register', 'sgor_warm_up'])
def test_a_reader_that_has_had_enough(name, pair):
    with subprocess.Popen(line(name, *(pair if name == 'sgor_register' else ())),
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.wait(400) == 141
        assert process.stderr.read() == b''


@pytest.mark.parametrize('name', ['sgor_register', 'sgor_warm_up'])
def test_a_screen_that_cannot_be_written(name, pair):
    with open('/dev/full', 'w') as full:
        said = subprocess.run(line(name, *(pair if name == 'sgor_register' else ())), stdout=full,
                              stderr=subprocess.PIPE, text=True, check=False)
    assert said.returncode == 3
    assert said.stderr == 'error: [Errno 28] No space left on device\n'


@pytest.mark.parametrize('name', ['sgor_replay', 'sgor_warm_up', 'sgor_node'])
@pytest.mark.parametrize('option', ['--help', '--version'])
@pytest.mark.parametrize('stdout', ['>/dev/full', '>&-', '| true'])
def test_help_that_nobody_can_read_is_no_error(name, option, stdout):
    said = ran('bash', '-c', f'set -o pipefail; "$0" "$@" {stdout}', *line(name, option))
    assert (said.returncode, said.stderr) == (0, '')


def test_streams_that_are_closed_or_full(pair, tmp_path):
    """As a service manager or a careless script starts a command."""
    shell = ['bash', '-c', '"$0" "${@:2}" --json "$1/$RANDOM.json"']
    for gone in ('>&-', '2>&-', '>&- 2>&-'):
        said = ran(*shell[:2], f'{shell[2]} {gone}', line('sgor_register')[0], tmp_path,
                   *line('sgor_register')[1:], *pair)
        assert said.returncode == 0, said.stderr
        assert 'Traceback' not in said.stderr
    assert len(list(tmp_path.glob('*.json'))) == 3
    said = ran('bash', '-c', '"$0" "$@" 2>/dev/full', *line('sgor_register', '/nope', pair[0]))
    assert said.returncode == 2


def test_a_fault_of_the_program_is_no_result(pair):
    code = ('import sys; from sgor_ros.commands import register;'
            'register.register = lambda *_: 1 / 0; sys.exit(register.main())')
    said = ran(sys.executable, '-c', code, *map(str, pair))
    assert said.returncode == 3
    assert 'ZeroDivisionError' in said.stderr
    assert said.stderr.splitlines()[-1].startswith('error: a fault of the program')


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_is_lost_comes_again_and_lets_the_command_clear_away(number):
    cleared = []

    def command(_):
        try:
            with suppress(BaseException):    # as a callback from C code does
                signal.raise_signal(number)
            time.sleep(60)
        finally:
            try:
                raise OSError
            except OSError:
                time.sleep(5 * AGAIN_S)
                cleared.append(True)
        return 0

    before = signal.getsignal(number)
    begin = time.monotonic()
    assert run(command, Namespace()) == 128 + number
    assert cleared == [True]
    assert time.monotonic() - begin < 30
    assert signal.getsignal(number) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.parametrize('name', ['sgor_register', 'sgor_replay', 'sgor_benchmark', 'library'])
def test_compiling_is_said_when_it_begins(name, pair, street_bag, tmp_path):
    """On a machine where nothing is compiled yet; then it is told to end, and does."""
    command = {'sgor_register': ('sgor_register', *pair),
               'sgor_replay': ('sgor_replay', street_bag, '--output', tmp_path / 'out'),
               'sgor_benchmark': ('sgor_benchmark', 'pairs', '--output', tmp_path / 'out')}
    process = subprocess.Popen(
        line(*command[name]) if name in command else [
            sys.executable, '-c', 'import sgor_ros, numpy as np; x = sgor_ros.SemanticScan('
            'np.random.default_rng(0).normal(0, 9, (5000, 3))); sgor_ros.register(x, x)'],
        env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'cache')},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr.readline().startswith('compiling for this machine')
        assert process.poll() is None
        time.sleep(0.5)
        process.send_signal(signal.SIGTERM)
        said = process.communicate(timeout=60)[1]
    finally:
        process.kill()
    assert process.returncode == (143 if name in command else -signal.SIGTERM), said
    assert not list(tmp_path.glob('out*'))
    assert 'Traceback' not in said
