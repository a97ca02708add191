"""Reads inputs within limits, in a process that may die of it: SEED FOLDER KIND:FIRST:LAST ...

Writes a line of JSON for each input that is neither read nor refused as it should be, and one at
the end of each kind; what is at work is in FOLDER/at.
"""
import json
import os
from pathlib import Path
import random
import resource
import shutil
import signal
import sys
import traceback

from doors import DOORS

from sgor_ros.core.common.settings import InputError

MOST_BYTES = 1 << 30
MOST_CPU_S, MOST_S = 5.0, 60.0
"""What hangs uses a core, or waits: the machine may have others to serve meanwhile."""


def main(seed, folder, *batches):
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for batch in batches:
        kind, first, last = batch.split(':')
        read_batch(kind, seed, range(int(first), int(last)), Path(folder))


def read_batch(kind, seed, indices, folder):
    door, room = DOORS[kind], folder / 'room'
    good = door.good()
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)
    fill(room, door, good[0])
    door.read(room / door.file)    # what is loaded once does not count
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MOST_BYTES,
                                            resource.RLIM_INFINITY))
    outcomes = {'kind': kind, 'read': 0, 'refused': 0}
    with open(folder / 'at', 'w') as at:
        for index in indices:
            os.pwrite(at.fileno(), f'{kind}:{index:<12d}'.encode(), 0)
            fill(room, door, input_of(kind, seed, index, good))
            error = guarded(door, room / door.file, outcomes)
            if error:
                print(json.dumps({'kind': kind, 'index': index, 'error': error}), flush=True)
            if error or index % 100 == 0 or index == indices[-1]:
                print(json.dumps(outcomes), flush=True)
                outcomes.update(read=0, refused=0)


def input_of(kind, seed, index, good):
    """Return an input by its number: the same wherever it is asked for."""
    return DOORS[kind].input(good, random.Random(f'{kind} {seed} {index}'))


def fill(room, door, data):
    shutil.rmtree(room, ignore_errors=True)
    for name, content in {door.file: data, **door.beside()}.items():
        (room / name).parent.mkdir(parents=True, exist_ok=True)
        (room / name).write_bytes(content)


def guarded(door, path, outcomes):
    """Read an input; return what is wrong with how that ended, or nothing."""
    signal.setitimer(signal.ITIMER_PROF, MOST_CPU_S)
    signal.setitimer(signal.ITIMER_REAL, MOST_S)
    try:
        door.read(path)
    except InputError as error:
        cause = error
        while cause is not None:
            if isinstance(cause, MemoryError):
                return f'more memory than {MOST_BYTES} bytes: {error!r}\n' + traceback.format_exc()
            cause = cause.__cause__
        if not str(error).isprintable():
            return f'a message that no terminal shows as it is: {str(error)!r}'
        outcomes['refused'] += 1
    except BaseException:
        return traceback.format_exc()
    else:
        outcomes['read'] += 1
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
    return None


if __name__ == '__main__':
    main(*sys.argv[1:])
