"""Long work tells how far it is: a bar on a terminal, lines in a log; what is stopped is kept."""
import csv
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from sgor_ros import warm_up
from sgor_ros.evaluation.report.tables import markdown
from sgor_ros.io import terminal

CONTROL = re.compile(r'\x1b|\r')


@pytest.fixture(scope='module')
def drive(street, tmp_path_factory):
    """Return a folder with a drive of four scans, with poses."""
    warm_up()
    folder = tmp_path_factory.mktemp('drives') / '00'
    for name in ('velodyne', 'labels'):
        (folder / name).mkdir(parents=True)
    for i, (points, labels, _) in enumerate(street):
        np.column_stack((points, np.ones(len(points)))).astype(np.float32).tofile(
            folder / f'velodyne/{i:06d}.bin')
        labels.astype(np.uint32).tofile(folder / f'labels/{i:06d}.label')
    np.savetxt(folder / 'poses.txt', [T[:3].ravel() for _, _, T in street])
    return folder


class Screen:
    """A process whose standard error, and output where that is wanted, is a terminal."""

    def __init__(self, module, *arguments, stdout=None, columns=100, **variables):
        self._side, other = pty.openpty()
        self.text = ''
        self.process = subprocess.Popen(
            [sys.executable, '-m', f'sgor_ros.commands.{module}', *map(str, arguments)],
            stdin=subprocess.DEVNULL, stdout=stdout or other, stderr=other,
            env={**os.environ, 'TERM': 'xterm', 'COLUMNS': str(columns), **variables})
        os.close(other)

    def read_until(self, words, seconds=300):
        """Read until words are on the screen; None: to the end."""
        end = time.monotonic() + seconds
        while words is None or words not in self.text:
            assert time.monotonic() < end, self.text
            try:
                self.text += os.read(self._side, 4096).decode(errors='replace')
            except OSError:    # the other side is closed
                assert words is None, self.text
                break
        return self.text

    def end(self):
        self.read_until(None)
        os.close(self._side)
        return self.process.wait(60)


def lines_of(text):
    """Return what was on the lines of a screen, without colours."""
    plain = re.sub(r'\x1b\[[\d;?]*[A-Za-z]|\r', '\n', re.sub(r'\x1b\[[\d;]*m', '', text))
    return [line for line in plain.split('\n') if line.strip()]


def test_a_bar_on_a_terminal_and_nothing_of_it_elsewhere(drive, tmp_path):
    screen = Screen('replay', drive, '--output', tmp_path / 'one', stdout=subprocess.PIPE)
    assert screen.end() == 0
    assert '4/4 scans' in ' '.join(lines_of(screen.text))
    # the cursor, which a bar hides, is back
    assert screen.text.rindex('\x1b[?25h') > screen.text.rindex('\x1b[?25l')
    said = screen.process.stdout.read().decode()
    assert '4 of 4 scans have a pose' in said
    assert not CONTROL.search(said)
    log = subprocess.run([sys.executable, '-m', 'sgor_ros.commands.replay', drive, '--output',
                          tmp_path / 'two'], capture_output=True, text=True, check=True,
                         env={**os.environ, 'FORCE_COLOR': '1', 'TERM': 'xterm'})
    assert not CONTROL.search(log.stderr + log.stdout)


def test_a_terminal_without_a_cursor_gets_no_control_characters(drive, tmp_path):
    screen = Screen('replay', drive, '--output', tmp_path / 'out', TERM='dumb')
    assert screen.end() == 0
    # evo brings colorama, which puts the colours of any terminal back at the end
    assert '\x1b' not in screen.text.replace('\x1b[0m', '')


def test_a_log_gets_a_line_now_and_then(capsys, monkeypatch):
    clock = iter(np.arange(0.0, 1000.0, 10.0))
    monkeypatch.setattr(terminal.time, 'monotonic', lambda: float(next(clock)))
    with terminal.progress('drive', 12, 'scan') as told:
        assert list(told.over('abcdefghijkl')) == list('abcdefghijkl')
    assert capsys.readouterr() == ('', (
        'drive: 3 of 12 scans in 0:30 min, 1:30 min left\n'
        'drive: 6 of 12 scans in 1:00 min, 1:00 min left\n'
        'drive: 9 of 12 scans in 1:30 min, 0:30 min left\n'
        'drive: 12 of 12 scans in 2:00 min, 0:00 min left\n'))
    with terminal.progress('bag', None, 'scan') as told:
        list(told.over(range(3)))
    assert capsys.readouterr().err == 'bag: 3 scans in 0:30 min\n'


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_benchmark_that_is_stopped_keeps_what_it_has_measured(drive, tmp_path, number):
    out = tmp_path / 'out'
    screen = Screen('benchmark', 'pairs', '--data', drive, '--methods', 'sgor', 'paper',
                    '--wrong', 0, '--output', out)
    screen.read_until('2/6')
    screen.process.send_signal(number)
    assert screen.end() == 128 + number
    assert f'what was measured until now is in {out}' in ''.join(lines_of(screen.text))
    with open(out / 'rows.csv') as file:
        rows = list(csv.DictReader(file))
    pairs = {(row['source'], row['target']) for row in rows}
    assert 2 <= len(pairs) < 6
    assert len(rows) == 2 * len(pairs)
    assert all(row['within'] == 'True' for row in rows if row['method'] == 'SGOR')
    table = (out / 'table.md').read_text()
    assert f'Stopped after {len(pairs)} pairs.' in table
    assert f'| SGOR | 100.0 % ({len(pairs)}/{len(pairs)}) |' in table
    assert json.loads((out / 'run.json').read_text())['stopped'] is True
    assert [path.name for path in tmp_path.iterdir()] == ['out']


def test_tables_are_drawn_on_a_terminal_and_markdown_in_a_pipe(drive, tmp_path):
    arguments = ('pairs', '--data', drive, '--methods', 'sgor', '--wrong', 0, '--limit', 1)
    screen = Screen('benchmark', *arguments, '--output', tmp_path / 'one')
    assert screen.end() == 0
    shown = lines_of(screen.text)
    assert not [line for line in shown if line.startswith('|')]
    assert [line for line in shown if line.startswith('│ recall ')]
    assert max(map(len, shown)) <= 100
    said = Screen('benchmark', *arguments, '--output', tmp_path / 'two', stdout=subprocess.PIPE)
    assert said.end() == 0
    assert '| SGOR | 100.0 % (1/1) |' in said.process.stdout.read().decode()


def test_a_table_that_is_too_wide_is_turned(monkeypatch, capsys):
    monkeypatch.setattr(terminal, '_is_screen', lambda _: True)
    header = ['method', *(f'quantity {i} [ms]' for i in range(9))]
    text = markdown(header, [['SGOR [b]', *map(str, range(10, 19))]]) + '\n\nRE [deg]: median.'
    for columns, first in ((200, '┃ method   ┃ quantity 0 [ms] ┃'),
                           (80, '┃ method          ┃ SGOR [b] ┃')):
        monkeypatch.setenv('COLUMNS', str(columns))
        terminal.show(text)
        said = capsys.readouterr().out
        assert first in said
        assert 'RE [deg]: median.' in said
        assert max(map(len, said.splitlines())) <= columns
    assert re.search(r'│ quantity 3 \[ms\] │ +13 │', said)
