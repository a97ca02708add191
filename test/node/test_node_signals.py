"""Signals end the node cleanly, whatever it is doing. SGOR_RUNS=100 tries each moment so often."""
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import ros_helpers as ros

from sgor_ros.ros.playback.node_process import NodeProcess
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

RUNS = int(os.environ.get('SGOR_RUNS', '2'))
# a machine may be slow; a node that hangs never ends
TIMEOUT_S = 30.0
KINDS = [(signal.SIGTERM,), (signal.SIGINT,), (signal.SIGINT, signal.SIGINT),
         (signal.SIGINT, signal.SIGTERM, signal.SIGINT)]
COUNTS = r'received \d+, processed \d+, replaced \d+, failed 0'


@pytest.fixture(scope='module')
def clouds():
    lidar = Lidar(beams=32, columns=600)
    return [ros.cloud(points, labels, round(1e9 * (100 + stamp)))
            for stamp, points, labels, _ in simulate(6, seed=0, lidar=lidar)]


def trials(seed):
    """Yield for each run its signals and a share of the time in which they may come."""
    rng = np.random.default_rng(seed)
    for run in range(RUNS):
        yield KINDS[(run + seed) % len(KINDS)], rng.uniform()


def end(node, signals):
    """Send signals close to each other, and return the seconds to the end of the node."""
    begin = time.monotonic()
    for number in signals:
        node.process.send_signal(number)
        time.sleep(0.03)
    node.process.wait(TIMEOUT_S)
    return time.monotonic() - begin


def assert_clean(node, seconds, moment):
    log = node.log.read_text()
    assert node.process.returncode == 0, f'{moment}: {node.process.returncode}\n{log}'
    for word in ('Traceback', 'Error', 'terminate'):
        assert word not in log, f'{moment}\n{log}'
    print(f'{moment}: ended after {seconds:.2f} s')


def await_handlers(process):
    """Return once the program has begun: before that, a signal is Python's own affair."""
    bit = 1 << (signal.SIGTERM - 1)
    while process.poll() is None:
        with open(f'/proc/{process.pid}/status') as status:
            masks = re.findall(r'SigCgt:\s*(\w+)', status.read())
        if any(int(mask, 16) & bit for mask in masks):
            return
        time.sleep(0.002)


def test_while_it_starts(domain, tmp_path):
    for signals, share in trials(0):
        with NodeProcess(domain, tmp_path / 'log') as node:
            await_handlers(node.process)
            time.sleep(3.0 * share)
            assert_clean(node, end(node, signals), f'starting, {3 * share:.2f} s')


def test_while_it_compiles(domain, tmp_path, monkeypatch):
    """Nothing is compiled yet, as after installing it."""
    for run, (signals, share) in enumerate(trials(1)):
        monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / f'cache{run}'))
        with NodeProcess(domain, tmp_path / 'log') as node:
            while 'compiling' not in node.log.read_text():
                assert node.alive(), node.log.read_text()
                time.sleep(0.05)
            time.sleep(5.0 * share)
            assert 'ready' not in node.log.read_text()
            assert_clean(node, end(node, signals), f'compiling, {5 * share:.2f} s')


def test_while_it_is_idle(domain, tmp_path):
    for signals, share in trials(2):
        with NodeProcess(domain, tmp_path / 'log') as node:
            while 'ready' not in node.log.read_text():
                assert node.alive(), node.log.read_text()
                time.sleep(0.02)
            time.sleep(share)
            assert_clean(node, end(node, signals), f'idle, {share:.2f} s')
        assert re.fullmatch(COUNTS, node.log.read_text().splitlines()[-1])


def test_at_work(domain, clouds, tmp_path):
    for signals, share in trials(3):
        with NodeProcess(domain, tmp_path / 'log') as node, ros.Partner(domain) as partner:
            partner.wait_for_node(node.alive)
            partner.play(ros.stamped(clouds[:3]), 0.05)
            partner.spin_until(lambda heard=partner.odometry: heard)
            partner.play(ros.stamped(clouds[3:]), 0.01)
            partner.spin_for(0.2 * share)
            assert_clean(node, end(node, signals), f'at work, {0.2 * share:.2f} s')
        assert re.fullmatch(COUNTS, node.log.read_text().splitlines()[-1])


@pytest.mark.parametrize('stream', ['stdout', 'stderr', 'both'])
def test_with_nowhere_to_print(domain, stream):
    """A disk that is full, as of a log: it works, and ends as it should."""
    with open('/dev/full', 'w') as full:
        streams = {name: full if stream in (name, 'both') else subprocess.DEVNULL
                   for name in ('stdout', 'stderr')}
        process = subprocess.Popen([sys.executable, '-m', 'sgor_ros.ros.main'],
                                   env=domain.environment(), **streams)
    partner = ros.Partner(domain)
    try:
        partner.wait_for_node(lambda: process.poll() is None)
        process.send_signal(signal.SIGINT)
        assert process.wait(TIMEOUT_S) == 0
    finally:
        process.kill()
        partner.close()
