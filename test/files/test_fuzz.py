"""Every door, for some seconds: spoilt inputs are read or refused, whatever they claim."""
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

FUZZ = Path(__file__).parents[1] / 'fuzz'
COUNT = 80
DOORS = """
import os
from sgor_ros.core.common.settings import InputError


class Door:
    file = 'a'
    read = staticmethod(lambda path: WAYS[path.read_bytes()]())
    good = staticmethod(lambda: [b'good'])
    beside = staticmethod(dict)

    def __init__(self, name):
        self.name = name

    def input(self, good, rng):
        return self.name


def hang():
    while True:
        pass


def allocate():
    try:
        bytearray(1 << 31)
    except MemoryError as error:
        raise InputError('too large') from error


def refuse():
    raise InputError('no')


WAYS = {b'die': os.abort, b'hang': hang, b'allocate': allocate, b'raise': lambda: [][0],
        b'refuse': refuse, b'good': int}
DOORS = {name.decode(): Door(name) for name in WAYS}
"""


def fuzz(folder, *options):
    return subprocess.run([sys.executable, folder, *options], capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': str(FUZZ.parents[1])})


def test_no_spoilt_input_gets_past_an_input_error():
    """The long run is `python test/fuzz --count 20000`."""
    done = fuzz(FUZZ, '--count', str(COUNT), '--seed', 'suite')
    assert done.returncode == 0, done.stdout + done.stderr
    counts = re.findall(rf'(\w+) +{COUNT} inputs: +(\d+) read, +(\d+) refused, +0 wrong',
                        done.stdout)
    assert len(counts) == 26
    for kind, read, refused in counts:
        assert int(read) + int(refused) == COUNT, kind
        assert int(read) > 0, f'{kind}: nothing is let in, so little is tried'


def test_what_goes_wrong_is_seen(tmp_path):
    """A reader that dies, hangs, allocates or raises anything else does not pass."""
    shutil.copy(FUZZ / '__main__.py', tmp_path)
    limits = (FUZZ / 'worker.py').read_text()
    assert 'MOST_CPU_S, MOST_S = 5.0, 60.0' in limits
    (tmp_path / 'worker.py').write_text(limits.replace('5.0, 60.0', '0.5, 60.0'))
    (tmp_path / 'doors.py').write_text(DOORS)
    done = fuzz(tmp_path, '--count', '1', '--jobs', '1')
    assert done.returncode == 1, done.stderr
    counts = re.findall(r'(\w+) +1 inputs: +(\d) read, +(\d) refused, +(\d) wrong', done.stdout)
    assert counts == [('die', '0', '0', '1'), ('hang', '0', '0', '1'), ('allocate', '0', '0', '1'),
                      ('raise', '0', '0', '1'), ('refuse', '0', '1', '0'), ('good', '1', '0', '0')]
    for says in ('ended by 6', 'ended by 27 it computed too long', 'more memory', 'IndexError'):
        assert says in done.stdout
