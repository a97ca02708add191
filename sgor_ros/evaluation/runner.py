"""Runs methods on pairs: in turns, resumed after a kill, over processes or a Dask cluster."""
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from concurrent.futures import as_completed
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import asdict
from dataclasses import dataclass
import json
import multiprocessing
from pathlib import Path
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError
from ..core.config import SgorConfig
from . import rows as table
from .extra import INSTALL
from .extra import progress
from .methods.method import Estimate
from .methods.method import Method
from .metrics.consistency import nees
from .metrics.registration import inlier_mask
from .metrics.registration import inlier_scores
from .metrics.registration import InlierScores
from .metrics.registration import kept_scores
from .metrics.registration import rotation_error_deg
from .metrics.registration import translation_error_m
from .pairs.front_end import Features
from .pairs.front_end import scans_of
from .pairs.front_end import shared_matches
from .pairs.front_end import Variant
from .pairs.pair import Matches
from .pairs.pair import Pair
from .pairs.pair import Scans
from .protocols.protocol import Protocol
from .report.files import environment
from .rows import Row

Array = NDArray[np.float64]
Key = tuple[str, int, str]
"""Name of the variant, number of the pair, name of the method."""


@dataclass(frozen=True, eq=False)
class Job:
    """Methods on one pair in one variant: what goes to another process."""

    index: int
    pair: Pair
    variant: Variant
    methods: Sequence[Method]
    front_end: SgorConfig
    inlier_m: float
    turn_seed: int | None
    features: Features | None
    repeats: int

    def __call__(self) -> list[list[Row]]:
        """Run them in changing order on the same input; return the rows of each, in order."""
        made: dict[SgorConfig | None, tuple[Scans | Matches, Array | None]] = {}
        rows: list[list[Row]] = [[] for _ in self.methods]
        rng = np.random.default_rng(self.index)
        for _ in range(self.repeats):
            for chosen in rng.permutation(len(self.methods)):
                method = self.methods[chosen]
                needs = None if method.takes == 'scans' else method.front_end or self.front_end
                if needs not in made:
                    made[needs] = self._input(needs)
                given, truth = made[needs]
                begin = time.perf_counter(), time.process_time()
                estimate = method.run(given)
                spent = time.perf_counter() - begin[0], time.process_time() - begin[1]
                rows[chosen].append(self._row(method, given, truth, estimate, spent))
        return rows

    def _input(self, front_end: SgorConfig | None) -> tuple[Scans | Matches, Array | None]:
        """Return scans, or the matches of a front end, and the truth."""
        if front_end is None:
            return scans_of(self.pair,
                            None if self.turn_seed is None else self.turn_seed + self.index)
        return (shared_matches(self.pair, front_end, self.inlier_m, self.variant, self.features),
                self.pair.T_target_source)

    def _row(self, method: Method, given: Scans | Matches, truth: Array | None,
             estimate: Estimate, spent: tuple[float, float]) -> Row:
        pair, T, result = self.pair, estimate.T_target_source, estimate.registration
        found: dict[str, Any] = {}
        re = te = float('nan')
        if truth is not None and T is not None and np.isfinite(T).all():
            known = np.array([1.0, 1.0, float(pair.heights_known), 1.0])[:, None]
            re, te = rotation_error_deg(T, truth), translation_error_m(known * T, known * truth)
            if result is not None and pair.heights_known:
                found['nees'] = nees(T, truth, result.covariance)
        if result is not None:
            found |= {'confidence': float('nan') if T is None else result.confidence,
                      'degenerate': len(result.degenerate),
                      'alternatives': len(result.alternatives)}
        if isinstance(given, Matches) and truth is not None:
            found |= _match_scores(given, truth, estimate)
        return Row(
            method.name, pair.name, pair.group, re, te,
            spent[0] if estimate.seconds is None else estimate.seconds, self.variant.name,
            '' if pair.source is None else pair.source.name,
            '' if pair.target is None else pair.target.name, pair.same_place, pair.distance_m,
            estimate.accepted and T is not None, estimate.score, estimate.seconds_one_new,
            spent[1], **found)


def _match_scores(given: Matches, truth: Array, estimate: Estimate) -> dict[str, Any]:
    T, kept = estimate.T_target_source, estimate.kept
    if kept is not None:
        scores = kept_scores(given.source, given.target, kept, truth, given.inlier_m)
    elif T is not None:
        scores = inlier_scores(given.source, given.target, T, truth, given.inlier_m)
    else:
        scores = InlierScores(0.0, 0.0, 0.0)
    right = inlier_mask(given.source, given.target, truth, given.inlier_m)
    return {'matches': len(right), 'inlier_share': float(right.mean()) if len(right) else 0.0,
            **asdict(scores)}


def run(protocol: Protocol, methods: Sequence[Method], folder: Path | None = None, *,
        variants: Sequence[Variant] = (Variant(),), features: Features | None = None,
        processes: int = 1, dask: str = '', repeats: int = 1, warm_up: bool = False
        ) -> list[Row]:
    """Run all methods on all pairs; what `folder` has already is not run again.

    Parameters
    ----------
    protocol : Protocol
    methods : sequence of Method
    folder : Path, optional
        Gets ``pairs.csv``, a row for each pair and method as it is done, and ``setup.json``.
    variants : sequence of Variant
        Of a study.
    features : Features, optional
        In place of FPFH.
    processes : int
        On this machine.
    dask : str
        Address of a scheduler, to run on its workers instead.
    repeats : int
        Of each method on each pair, in turns, for times; a row each. Only without a folder.
    warm_up : bool
        Run each method on the first pair once before.

    Returns
    -------
    list of Row
        In the order of variants, pairs and methods, whatever order they were done in; with a
        folder, what ``pairs.csv`` holds of them.

    Raises
    ------
    InputError
        The folder holds a run with other settings.
    """
    def job(index: int, variant: Variant, some: Sequence[Method], repeats: int) -> Job:
        return Job(index, protocol.pairs[index], variant, some, protocol.front_end,
                   protocol.inlier_m, protocol.turn_seed, features, repeats)

    done: dict[Key, list[Row]] = {}
    if folder is not None:
        done = _resumed(folder, protocol, features)
    jobs = []
    for variant in variants:
        for index in range(len(protocol.pairs)):
            missing = [m for m in methods if (variant.name, index, m.name) not in done]
            if missing:
                jobs.append(job(index, variant, missing, repeats))
    if warm_up and jobs:
        job(0, variants[0], methods, 1)()
    with ExitStack() as stack:
        file = None if folder is None else stack.enter_context((folder / 'pairs.csv').open('a'))
        for each, found in progress(_completed(jobs, processes, dask), protocol.name, len(jobs)):
            done |= {(each.variant.name, each.index, method.name): rows
                     for method, rows in zip(each.methods, found, strict=True)}
            if file is not None:
                file.write(table.lines(row for rows in found for row in rows))
                file.flush()
    if folder is not None:
        # the same, whether a run was resumed or not
        done = _by_key(table.read(folder / 'pairs.csv'), protocol)
    return [row for variant in variants for index in range(len(protocol.pairs))
            for method in methods for row in done[variant.name, index, method.name]]


def _resumed(folder: Path, protocol: Protocol, features: Features | None) -> dict[Key, list[Row]]:
    """Return the rows that a folder has, and make it ready for those that are missing."""
    folder.mkdir(parents=True, exist_ok=True)
    # methods and variants may be added to a run; what rows depend on may not change
    _same_setup(folder / 'setup.json', {
        'protocol': protocol.name, 'inlier_m': protocol.inlier_m,
        'features': '' if features is None else str(features.folder),
        'front_end': asdict(protocol.front_end)})
    path = folder / 'pairs.csv'
    rows = table.read(path)
    # what was cut off in the middle of a line goes
    path.write_text(table.TABLES_HEADER + table.lines(rows))
    return _by_key(rows, protocol)


def _by_key(rows: Iterable[Row], protocol: Protocol) -> dict[Key, list[Row]]:
    index = {pair.name: number for number, pair in enumerate(protocol.pairs)}
    return {(row.variant, index[row.pair], row.method): [row] for row in rows
            if row.pair in index}


def _same_setup(path: Path, setup: dict[str, Any]) -> None:
    if path.is_file():
        before = json.loads(path.read_text())
        if before['run'] != json.loads(json.dumps(setup)):
            raise InputError(f'{path.parent}: holds a run with other settings; take another '
                             'folder or remove it')
        return
    beside = path.with_suffix('.part')
    beside.write_text(json.dumps({'run': setup, **environment()}, indent=1, default=str) + '\n')
    beside.replace(path)


Done = tuple[Job, list[list[Row]]]


def _completed(jobs: Sequence[Job], processes: int, dask: str) -> Iterator[Done]:
    """Yield the jobs with their rows, in any order."""
    if dask:
        yield from _by_dask(jobs, dask)
    elif processes == 1 or len(jobs) < 2:
        for job in jobs:
            yield job, job()
    else:
        # threads of the parent do not survive a fork
        context = multiprocessing.get_context('spawn')
        with ProcessPoolExecutor(processes, context) as pool:
            sent = {pool.submit(_call, job): job for job in jobs}
            for future in as_completed(sent):
                yield sent[future], future.result()


def _by_dask(jobs: Iterable[Job], address: str) -> Iterator[Done]:
    try:
        from distributed import as_completed as completed
        from distributed import Client
    except ImportError as error:
        raise InputError(f'--dask needs distributed ({error}): {INSTALL}') from error
    connect: Any = Client
    try:
        client = connect(address, timeout='10s')
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f'--dask {address}: no scheduler there: {error}') from error
    with client:
        results: Any = completed
        sent = {client.submit(_call, job, pure=False): job for job in jobs}
        for future, found in results(list(sent), with_results=True):
            yield sent[future], found


def _call(job: Job) -> list[list[Row]]:
    return job()


def peak_memory_mb(methods: Iterable[Method], scans: Scans) -> dict[str, float]:
    """Return the peak memory of a process of its own for each method, by name, and for none.

    A high-water mark cannot be reset, so methods in one process would share it.
    """
    spawn = multiprocessing.get_context('spawn')
    found = {}
    for name, call in (('', _nothing), *((method.name, method.run) for method in methods)):
        with ProcessPoolExecutor(1, mp_context=spawn) as process:
            found[name] = process.submit(_peak, call, scans).result()
    return found


def _nothing(_: Scans) -> Estimate:
    return Estimate(None)


def _peak(call: Callable[[Scans], Estimate], scans: Scans) -> float:
    for _ in range(3):
        call(scans)
    # ru_maxrss would start from that of the parent
    status = Path('/proc/self/status').read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in status if line.startswith('VmHWM'))
