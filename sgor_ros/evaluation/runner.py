"""Runs methods on the pairs of a protocol, in turns, so that noise of the machine hits all alike.

In this process, in several or on a Dask cluster; with a folder a run that was stopped goes on.
"""
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from concurrent.futures import as_completed
from contextlib import nullcontext
from dataclasses import asdict
from dataclasses import replace
import json
from pathlib import Path

import numpy as np

from ..core.common.settings import InputError
from ..io.executors import executor
from ..io.terminal import progress
from .front_end import Features
from .job import Job
from .methods import Method
from .metrics import row as table
from .metrics.row import Row
from .output import describe_run
from .protocols.pairs import Pair
from .protocols.protocol import outdoor
from .protocols.protocol import Protocol
from .protocols.studies import Variant


def run_pairs(pairs: Sequence[Pair], methods: Sequence[Method], seed: int,
              kept: list[Row] | None = None) -> list[Row]:
    """Run methods on raw scans whose sources are turned, after a run of each to warm up.

    `kept` gets the rows as they are done.
    """
    protocol = outdoor('pairs', pairs)
    Job(replace(protocol, pairs=pairs[:1]), Variant(), methods, turn_seed=seed)()
    return run(protocol, methods, turn_seed=seed, kept=kept)


def run(protocol: Protocol, methods: Sequence[Method], folder: Path | None = None, *,
        variants: Sequence[Variant] = (Variant(),), features: Features | None = None,
        turn_seed: int | None = None, processes: int = 1, dask: str = '',
        data: str = '', kept: list[Row] | None = None) -> list[Row]:
    """Run all methods on all pairs, in an order that changes from pair to pair.

    Parameters
    ----------
    protocol : Protocol
    methods : sequence of Method
    folder : Path, optional
        Gets ``pairs.csv``, a row for each pair and method as it is done, and ``setup.json``; what
        it has already is not run again.
    variants : sequence of Variant
        Of a study.
    features : Features, optional
        In place of FPFH.
    turn_seed : int, optional
        Turns the source of each pair for methods on raw scans.
    processes : int
        On this machine.
    dask : str
        Address of a scheduler, to run on its workers instead.
    data : str
        What the pairs are of: rows of other data are not taken for theirs.
    kept : list of Row, optional
        Gets the rows as they are done, for who is stopped before the end.

    Returns
    -------
    list of Row
        In the order of variants, pairs and methods, whatever order they were done in; with a
        folder, what its file holds of them.

    Raises
    ------
    InputError
        The folder holds a run with other settings.
    """
    path = None if folder is None else folder / 'pairs.csv'
    done: dict[tuple[str, str, str], Row] = {}
    if folder is not None and path is not None:
        folder.mkdir(parents=True, exist_ok=True)
        _same_setup(folder / 'setup.json', protocol, features, data)
        done = _by_key(table.read(path, protocol.thresholds[0]))
        # what was cut off in the middle of a line goes
        path.write_text(','.join(table.MATCH_COLUMNS) + '\n' + table.lines(done.values()))
    jobs = []
    rng = np.random.default_rng(turn_seed or 0)
    for variant in variants:
        for index, pair in enumerate(protocol.pairs):
            order = [methods[chosen] for chosen in rng.permutation(len(methods))]
            missing = [m for m in order if (variant.name, pair.name, m.name) not in done]
            if missing:
                jobs.append(Job(replace(protocol, pairs=[pair]), variant, missing, features,
                                None if turn_seed is None else turn_seed + index))
    with (nullcontext() if path is None else path.open('a') as file,
          progress(protocol.name, len(jobs), 'pair') as told):
        for rows in _completed(jobs, processes, dask):
            if file is not None:
                file.write(table.lines(rows))
                file.flush()
            done |= _by_key(rows)
            if kept is not None:
                kept += rows
            told.step()
    if path is not None:
        done = _by_key(table.read(path, protocol.thresholds[0]))
    return [done[variant.name, pair.name, method.name] for variant in variants
            for pair in protocol.pairs for method in methods]


def _by_key(rows: Iterable[Row]) -> dict[tuple[str, str, str], Row]:
    return {(row.variant, row.pair, row.method): row for row in rows}


def _completed(jobs: Sequence[Job], processes: int, dask: str) -> Iterator[list[Row]]:
    """Yield the rows of each job, in any order."""
    with executor(1 if len(jobs) < 2 else processes, dask) as workers:
        if workers is None:
            for job in jobs:
                yield job()
        else:
            for done in as_completed([workers.submit(_call, job) for job in jobs]):
                yield done.result()


def _call(job: Job) -> list[Row]:
    return job()


def _same_setup(path: Path, protocol: Protocol, features: Features | None, data: str) -> None:
    # methods and variants may be added to a run; what rows depend on may not change
    setup = {'protocol': protocol.name, 'inlier_m': protocol.inlier_m,
             'data': data, 'features': '' if features is None else str(features.folder),
             'front_end': asdict(protocol.front_end)}
    if path.is_file():
        before, now = json.loads(path.read_text())['run'], json.loads(json.dumps(setup))
        # what older runs do not tell cannot be compared
        if changed := [key for key, value in now.items() if before.get(key, value) != value]:
            raise InputError(f'{path.parent}: holds a run with another {", ".join(changed)}; take '
                             'another folder or remove it')
        return
    beside = path.with_suffix('.part')
    document = {'run': setup, **describe_run()}
    beside.write_text(json.dumps(document, indent=1, default=str) + '\n')
    beside.replace(path)
