"""Runs the methods of a protocol: resumed after a kill, over processes or a Dask cluster."""
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from concurrent.futures import as_completed
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from dataclasses import dataclass
import json
import multiprocessing
from pathlib import Path
import time
from typing import Any

import numpy as np
from tqdm import tqdm

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...io.environment import describe_environment
from ..methods import Matches
from ..methods import Method
from ..methods import Solution
from ..metrics import inlier_scores
from ..metrics import kept_scores
from ..metrics import rotation_error_deg
from ..metrics import translation_error_m
from ..report import PACKAGES
from ..report import revision
from ..rivals import Answer
from . import record
from .front_end import Features
from .front_end import shared_matches
from .front_end import Variant
from .record import Record
from .task import Protocol
from .task import Task

ScanMethod = Callable[[Task], Answer]
"""A method from raw scans on."""


@dataclass(frozen=True, eq=False)
class Entry:
    """A row of the table: a method on shared matches, with a front end of its own if any.

    Attributes
    ----------
    name : str
    method : Method or None
    front_end : SgorConfig or None
        None: that of the protocol.
    on_scans : ScanMethod or None
        In place of `method`.
    """

    name: str
    method: Method | None = None
    front_end: SgorConfig | None = None
    on_scans: ScanMethod | None = None


@dataclass(frozen=True, eq=False)
class Job:
    """All entries on one pair in one variant: what goes to another process."""

    task: Task
    variant: Variant
    entries: Sequence[Entry]
    front_end: SgorConfig
    inlier_m: float
    features: Features | None

    def __call__(self) -> list[Record]:
        """Run them in turns on the same matches."""
        made: dict[SgorConfig, Matches] = {}
        records = []
        for entry in self.entries:
            if entry.on_scans is not None:
                solution, seconds = _timed_answer(entry.on_scans, self.task)
                records.append(self._record(entry, None, solution, seconds))
                continue
            assert entry.method is not None
            config = entry.front_end or self.front_end
            if config not in made:
                made[config] = shared_matches(self.task, config, self.inlier_m, self.variant,
                                              self.features)
            begin = time.perf_counter()
            solution = entry.method(made[config])
            records.append(self._record(entry, made[config], solution,
                                        time.perf_counter() - begin))
        return records

    def _record(self, entry: Entry, matches: Matches | None, solution: Solution, seconds: float
                ) -> Record:
        T, truth = solution.T_target_source, self.task.T_target_source
        nothing = float('nan')
        precision = recall = f1 = share = nothing
        if matches is not None:
            share = float(np.mean(np.linalg.norm(
                matches.source @ truth[:3, :3].T + truth[:3, 3] - matches.target, axis=1)
                < self.inlier_m)) if len(matches.source) else 0.0
            kept = solution.kept
            scores = (kept_scores(matches.source, matches.target, kept, truth, self.inlier_m)
                      if kept is not None else
                      inlier_scores(matches.source, matches.target, T, truth, self.inlier_m)
                      if T is not None else None)
            precision, recall, f1 = ((scores.precision, scores.recall, scores.f1) if scores
                                     else (0.0, 0.0, 0.0))
        return Record(entry.name, self.variant.name, self.task.name, self.task.group,
                      nothing if T is None else rotation_error_deg(T, truth),
                      nothing if T is None else translation_error_m(T, truth),
                      precision, recall, f1, 0 if matches is None else len(matches.source), share,
                      seconds)


def _timed_answer(method: ScanMethod, task: Task) -> tuple[Solution, float]:
    answer = method(task)
    return Solution(answer.T_target_source), answer.seconds


def run(protocol: Protocol, entries: Sequence[Entry], folder: Path, *,
        variants: Sequence[Variant] = (Variant(),), features: Features | None = None,
        processes: int = 1, dask: str = '') -> list[Record]:
    """Run all entries on all pairs; what `folder` has already is not run again.

    Parameters
    ----------
    protocol : Protocol
    entries : sequence of Entry
    folder : Path
        Gets ``pairs.csv``, a row for each pair and method as it is done, and ``setup.json``.
    variants : sequence of Variant
        Of a study.
    features : Features, optional
        In place of FPFH.
    processes : int
        On this machine.
    dask : str
        Address of a scheduler, to run on its workers instead.

    Returns
    -------
    list of Record
        In the order of variants, tasks and entries, whatever order they were done in.

    Raises
    ------
    InputError
        The folder holds a run with other settings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _same_setup(folder / 'setup.json', _setup(protocol, entries, variants, features))
    path = folder / 'pairs.csv'
    done = {(r.variant, r.task, r.method): r for r in record.read(path)}
    jobs = []
    for variant in variants:
        for task in protocol.tasks:
            missing = [e for e in entries if (variant.name, task.name, e.name) not in done]
            if missing:
                jobs.append(Job(task, variant, missing, protocol.front_end, protocol.inlier_m,
                                features))
    # what was cut off in the middle of a line goes
    path.write_text(','.join(record.COLUMNS) + '\n' + record.lines(done.values()))
    with path.open('a') as file, tqdm(total=len(jobs), desc=protocol.name, unit='pair',
                                      disable=None) as bar:
        for found in _completed(jobs, processes, dask):
            file.write(record.lines(found))
            file.flush()
            done |= {(r.variant, r.task, r.method): r for r in found}
            bar.update()
    return [done[variant.name, task.name, entry.name] for variant in variants
            for task in protocol.tasks for entry in entries]


def _completed(jobs: Sequence[Job], processes: int, dask: str) -> Iterator[list[Record]]:
    """Yield the records of each job, in any order."""
    if dask:
        yield from _by_dask(jobs, dask)
    elif processes == 1 or len(jobs) < 2:
        for job in jobs:
            yield job()
    else:
        # threads of the parent do not survive a fork
        context = multiprocessing.get_context('spawn')
        with ProcessPoolExecutor(processes, context) as pool:
            for future in as_completed([pool.submit(_call, job) for job in jobs]):
                yield future.result()


def _by_dask(jobs: Iterable[Job], address: str) -> Iterator[list[Record]]:
    try:
        from distributed import as_completed as completed
        from distributed import Client
    except ImportError as error:
        raise InputError(f'--dask needs distributed ({error}): pip install distributed'
                         ) from error
    connect: Any = Client
    try:
        client = connect(address, timeout='10s')
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f'--dask {address}: no scheduler there: {error}') from error
    with client:
        results: Any = completed
        for _, found in results(client.map(_call, list(jobs), pure=False), with_results=True):
            yield found


def _call(job: Job) -> list[Record]:
    return job()


def _setup(protocol: Protocol, entries: Sequence[Entry], variants: Sequence[Variant],
           features: Features | None) -> dict[str, Any]:
    # entries and variants may be added to a run; what rows depend on may not change
    return {'protocol': protocol.name, 'inlier_m': protocol.inlier_m,
            'features': '' if features is None else str(features.folder),
            'front_end': asdict(protocol.front_end)}


def _same_setup(path: Path, setup: dict[str, Any]) -> None:
    if path.is_file():
        before = json.loads(path.read_text())
        if before['run'] != json.loads(json.dumps(setup)):
            raise InputError(f'{path.parent}: holds a run with other settings; take another '
                             'folder or remove it')
        return
    beside = path.with_suffix('.part')
    document = {'run': setup, 'environment': describe_environment(PACKAGES),
                'revision': revision()}
    beside.write_text(json.dumps(document, indent=1, default=str) + '\n')
    beside.replace(path)
