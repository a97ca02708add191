"""What the benchmarks share: settings, drives, right pairs, and how a table is left."""
from argparse import ArgumentParser
from argparse import Namespace
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
import sys
from typing import Any

from ...core.common.settings import InputError
from ...core.config import SgorConfig
from ...evaluation.metrics.row import Row
from ...evaluation.metrics.row import scan_records
from ...evaluation.output import save
from ...evaluation.protocols import pairs as pairing
from ...evaluation.protocols.pairs import Pair
from ...evaluation.report import tables
from ...io.datasets import Drive
from ...io.datasets import open_drives
from ...io.terminal import show

WORLD_SEEDS = (0, 1)
WORLD_SCANS, WORLD_SPEED = 40, 45.0
"""Of the pairs: scans 4.5 m apart, half way around the loop."""


def default_config(arguments: Namespace) -> SgorConfig:
    """Return the default settings on the cores that were asked for."""
    return SgorConfig(threads=arguments.cores)


def paper_config(arguments: Namespace) -> SgorConfig:
    """Return the paper's settings on the cores that were asked for."""
    return SgorConfig.paper().replace(threads=arguments.cores)


def add_max_distance(command: ArgumentParser) -> None:
    """Add how far apart the sensors of a right pair may be."""
    command.add_argument('--max-distance', type=float, default=36.0, metavar='M',
                         help='between the sensors of a right pair')


def add_kinds(command: ArgumentParser) -> None:
    """Add which kinds of places in the built-in world are meant."""
    command.add_argument('--kinds', nargs='+', metavar='KIND', help='of those; default: all')


def wants_world(arguments: Namespace) -> bool:
    """Return whether the built-in world takes part."""
    return bool(arguments.world or not arguments.data)


def drives_of(arguments: Namespace) -> list[Drive]:
    """Return the drives for pairs: those of the user, those of the world."""
    drives = data_drives(arguments)
    if wants_world(arguments):
        drives += [world_drive(seed, WORLD_SCANS, WORLD_SPEED) for seed in WORLD_SEEDS]
    return drives


def data_drives(arguments: Namespace) -> list[Drive]:
    """Return the drives of the user."""
    return open_drives(arguments.data) if arguments.data else []


def world_drive(seed: int, scans: int, speed: float) -> Drive:
    """Return a drive through the street of the built-in world."""
    try:
        from ...world import simulate
    except ImportError as error:
        raise InputError(f'the built-in world needs Open3D ({error}): pip install open3d'
                         ) from error
    say(f'building the world, seed {seed}')
    return pairing.drive_of(f'world/{seed}', (scan[1:] for scan in
                                              simulate(scans, seed, speed=speed)))


def right_pairs(arguments: Namespace, drives: Sequence[Drive], count: int) -> list[Pair]:
    """Choose pairs of the same place."""
    candidates = pairing.near_pairs(drives, arguments.max_distance)
    if arguments.data:
        candidates += pairing.listed_pairs(arguments.data, arguments.max_distance)
    if not candidates:
        raise InputError(f'{arguments.data or "world"}: no pairs within '
                         f'{arguments.max_distance:g} m; they need poses.txt or pairs.json')
    return pairing.choose(candidates, count, arguments.seed)


def finish(arguments: Namespace, folder: Path, text: str, records: list[dict[str, Any]],
           right: int = 0, wrong: int = 0) -> None:
    """Print the table and write it with its rows and what it was made with."""
    show(text)
    save(folder, text, records, {
        'options': vars(arguments), 'right_pairs': right, 'wrong_pairs': wrong,
        'config': asdict(default_config(arguments))})


@contextmanager
def kept_if_stopped(arguments: Namespace, folder: Path, rows: Sequence[Row]) -> Iterator[None]:
    """Write the rows that there are where the ``with`` ends early, by Ctrl-C or an error."""
    try:
        yield
    except BaseException:
        if rows:
            names = list(dict.fromkeys(row.method for row in rows))
            pairs = len({(row.source, row.target) for row in rows})
            save(folder, f'{tables.pairs_table(rows, names, {})}\n\nStopped after {pairs} pairs.',
                 scan_records(rows), {'options': vars(arguments), 'stopped': True,
                                      'config': asdict(default_config(arguments))})
        raise


def say(text: str) -> None:
    """Tell how far it is, beside the table."""
    if text:
        print(text, file=sys.stderr)
