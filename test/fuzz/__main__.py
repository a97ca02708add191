"""Fuzzes every door of the library: `python test/fuzz --count 20000`.

Each input is a good one, spoilt. It is read in a process of its own limits, and must be read or be
refused by InputError: no other exception, no signal, no 5 s of computing, no GB of memory.
"""
from argparse import ArgumentParser
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
import json
from pathlib import Path
import subprocess
import sys
import tempfile

from doors import DOORS
from worker import fill
from worker import input_of

HERE = Path(__file__).resolve().parent
BATCH = 1000
BATCHES_A_WORKER = 10
SIGNALS = {27: 'it computed too long', 14: 'it waited too long'}


def main():
    options = parser().parse_args()
    if options.one:
        kind, index = options.one.split(':')
        data = input_of(kind, options.seed, int(index), DOORS[kind].good())
        fill(Path(options.keep), DOORS[kind], data)
        return DOORS[kind].read(Path(options.keep) / DOORS[kind].file)
    batches = [(kind, first, min(first + BATCH, options.count))
               for first in range(0, options.count, BATCH) for kind in options.formats]
    workers = max(options.jobs, -(-len(batches) // BATCHES_A_WORKER))
    outcomes, errors = {kind: Counter() for kind in options.formats}, {}
    with ThreadPoolExecutor(options.jobs) as pool:
        for found in pool.map(lambda at: run(batches[at::workers], options.seed), range(workers)):
            for what in found:
                note(what, outcomes[what['kind']], errors)
    for kind, counts in outcomes.items():
        print(f'{kind:15} {options.count:8} inputs: {counts["read"]:7} read, '
              f'{counts["refused"]:7} refused, {counts["wrong"]:5} wrong')
    for (kind, error), indices in errors.items():
        print(f'{len(indices):6} times {kind}: {error}; such as --one {kind}:{indices[0]}')
    return 1 if errors else 0


def note(what, counts, errors):
    """Count what a worker told; print what is new and wrong."""
    if 'error' not in what:
        counts.update(read=what['read'], refused=what['refused'])
        return
    counts['wrong'] += 1
    known = (what['kind'], what['error'].strip().splitlines()[-1][:120])
    if known not in errors:
        print(f'{what["kind"]}:{what["index"]} {what["error"]}', flush=True)
    errors.setdefault(known, []).append(what['index'])


def run(batches, seed):
    """Return what became of the inputs; a worker that dies is followed by another."""
    found = []
    with tempfile.TemporaryDirectory(dir=shared_memory()) as folder:
        while batches:
            done = subprocess.run(
                [sys.executable, HERE / 'worker.py', seed, folder,
                 *(f'{kind}:{first}:{last}' for kind, first, last in batches)],
                capture_output=True, text=True)
            found += [json.loads(line) for line in done.stdout.splitlines() if line[:1] == '{']
            if done.returncode == 0:
                break
            at = Path(folder) / 'at'
            if not at.exists():
                raise RuntimeError(f'{batches}: the good input is not read: {done.stderr}')
            kind, index = at.read_text().split(':')
            signal = -done.returncode
            found.append({'kind': kind, 'index': int(index), 'error':
                          f'{done.stderr[-800:]}\nended by {signal} {SIGNALS.get(signal, "")}'})
            batches = rest_of(batches, kind, int(index))
    return found


def rest_of(batches, kind, index):
    """Return the batches that follow an input."""
    at = next(i for i, (name, first, last) in enumerate(batches)
              if name == kind and first <= index < last)
    rest = [(kind, index + 1, batches[at][2])] if index + 1 < batches[at][2] else []
    return rest + batches[at + 1:]


def shared_memory():
    """Return a folder in memory, where there is one: a file is written for each input."""
    return '/dev/shm' if Path('/dev/shm').is_dir() else None


def parser():
    command = ArgumentParser(prog='python test/fuzz', description=__doc__)
    command.add_argument('--count', type=int, default=1000, help='inputs of each format')
    command.add_argument('--seed', default='0', help='another one makes other inputs')
    command.add_argument('--formats', nargs='+', choices=list(DOORS), default=list(DOORS))
    command.add_argument('--jobs', type=int, default=2, help='processes at a time')
    command.add_argument('--one', metavar='FORMAT:NUMBER', help='read this one only, here')
    command.add_argument('--keep', default='/tmp/fuzzed', help='folder that --one writes it to')
    return command


if __name__ == '__main__':
    sys.exit(main())
