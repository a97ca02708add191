"""Compare the speed of two commits, in turns in one run: a history for whoever goes on.

    .venv/bin/python scripts/compare.py 1c5d096 . --data ../shared/data

Each commit is unpacked into ``out/compare`` (where it stays, with what numba compiles) and has a
process of its own; a dot is the checkout as it is. Both are asked in turns, so that what else the
machine does slows both. Matches and scans are the same files for both, made by this checkout. What
is called exists since 1c5d096: `register_correspondences`, `preprocess` and `register`.

Ratios are new over old. CPU time is that of all threads; its least value is what other processes
disturb least.
"""
from argparse import ArgumentDefaultsHelpFormatter
from argparse import ArgumentParser
import json
from pathlib import Path
import subprocess
import sys
import time

import numpy as np

FOLDER = Path('out/compare')
THREADS = 2


def main() -> None:
    """Prepare both commits, ask them in turns, print the ratios."""
    parser = ArgumentParser(description=__doc__.splitlines()[0],
                            formatter_class=ArgumentDefaultsHelpFormatter)
    parser.add_argument('old')
    parser.add_argument('new')
    parser.add_argument('--data', type=Path, help='folder as for sgor_benchmark; without, the '
                        'built-in world')
    parser.add_argument('--pairs', type=int, default=4, help='of scans')
    parser.add_argument('--counts', type=int, nargs='*', default=[2000, 8000],
                        help='of made-up matches')
    parser.add_argument('--rounds', type=int, default=15)
    arguments = parser.parse_args()
    tasks = make_tasks(arguments)
    workers = [start(commit) for commit in (arguments.old, arguments.new)]
    for worker in workers:
        for task in tasks:
            ask(worker, task)    # compiles
    found = {(task, side): [] for task in tasks for side in (0, 1)}
    for turn in range(arguments.rounds):
        for task in tasks:
            for side in ((0, 1), (1, 0))[turn % 2]:
                found[task, side].append(ask(workers[side], task))
    for worker in workers:
        worker.stdin.close()
        worker.wait()
    print(f'{arguments.rounds} rounds, {THREADS} threads; {arguments.new} over {arguments.old}\n')
    print('| task | wall, median | wall, least | CPU, median | CPU, least | old, CPU [ms] |\n'
          '|---|---:|---:|---:|---:|---:|')
    ratios = []
    for task in tasks:
        old, new = (np.array(found[task, side]) for side in (0, 1))
        ratio = [*(np.median(new, axis=0) / np.median(old, axis=0)), *(new.min(axis=0)
                                                                      / old.min(axis=0))]
        ratios.append([ratio[k] for k in (0, 2, 1, 3)])
        print(f'| {task} | ' + ' | '.join(f'{r:.2f}' for r in ratios[-1])
              + f' | {1e3 * old[:, 1].min():.1f} |')
    print('| median of these | ' + ' | '.join(f'{r:.2f}' for r in np.median(ratios, axis=0))
          + ' | |')


def make_tasks(arguments) -> list[str]:
    """Write matches and scans into the folder; return the names of what is to be timed."""
    from sgor_ros.commands.benchmarks.inputs import WORLD_SCANS
    from sgor_ros.commands.benchmarks.inputs import WORLD_SPEED
    from sgor_ros.evaluation.protocols import pairs as pairing
    from sgor_ros.evaluation.solver import fpfh_matches
    from sgor_ros.evaluation.solver import made_up
    from sgor_ros.io.datasets import open_drives
    FOLDER.mkdir(parents=True, exist_ok=True)
    if arguments.data:
        candidates = (pairing.listed_pairs(arguments.data, 36.0)
                      + pairing.near_pairs(open_drives(arguments.data), 36.0))
    else:
        from sgor_ros.world import simulate
        candidates = pairing.near_pairs([pairing.drive_of('street', (
            scan[1:] for scan in simulate(WORLD_SCANS, 0, speed=WORLD_SPEED)))], 36.0)
    chosen = pairing.choose(candidates, arguments.pairs, 0)
    sets = [(f'made up, {count}', made_up(count, 0.02, 0)) for count in arguments.counts]
    sets += [(f'FPFH, {m.name}', m) for m in fpfh_matches(chosen, 8000)]
    tasks = []
    for name, pair in sets:
        np.savez(FOLDER / f'{name}.npz', source=pair.matches.source, target=pair.matches.target)
        tasks += [f'{name}, default', f'{name}, paper']
    for pair in chosen:
        name = f'two raw scans, {pair.data_set}, {pair.distance_m:.0f} m'
        source, target = pair.source.read(), pair.target.read()
        np.savez(FOLDER / f'{name}.npz', source=source.points, target=target.points)
        tasks.append(f'{name}, default')
    return tasks


def start(commit: str) -> subprocess.Popen:
    """Return a process that runs this file with the sources of a commit."""
    tree = Path.cwd()
    if commit != '.':
        name = subprocess.check_output(['git', 'rev-parse', '--short', commit], text=True).strip()
        tree = (FOLDER / name).resolve()
        if not tree.is_dir():
            tree.mkdir()
            archive = subprocess.run(['git', 'archive', name], check=True, stdout=subprocess.PIPE)
            subprocess.run(['tar', '-x', '-C', tree], check=True, input=archive.stdout)
    return subprocess.Popen([sys.executable, __file__, '--worker', str(tree)], text=True,
                            stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def ask(worker: subprocess.Popen, task: str) -> list[float]:
    """Return the seconds, and those of the processor, that a task took."""
    worker.stdin.write(task + '\n')
    worker.stdin.flush()
    return json.loads(worker.stdout.readline())


def work(tree: str) -> None:
    """Read names of tasks, run each, write how long it took."""
    sys.path.insert(0, tree)
    from sgor_ros import register
    from sgor_ros import register_correspondences
    from sgor_ros import SemanticScan
    from sgor_ros import SgorConfig
    # with the sizes that the paper's preset had in the beginning
    configs = {'default': SgorConfig().replace(threads=THREADS),
               'paper': SgorConfig.paper().replace(threads=THREADS, groups=200, group_size=400)}
    inputs = {}
    for line in sys.stdin:
        name, preset = line.rstrip('\n').rsplit(', ', 1)
        if name not in inputs:
            with np.load(FOLDER / f'{name}.npz') as file:
                inputs[name] = file['source'], file['target']
        source, target = inputs[name]
        before = time.perf_counter(), time.process_time()
        if name.startswith('two raw scans'):
            register(SemanticScan(source), SemanticScan(target), configs[preset])
        else:
            register_correspondences(source, target, config=configs[preset])
        print(json.dumps([time.perf_counter() - before[0], time.process_time() - before[1]]),
              flush=True)


if __name__ == '__main__':
    if sys.argv[1:2] == ['--worker']:
        work(sys.argv[2])
    else:
        main()
