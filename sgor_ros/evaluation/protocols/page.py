"""The results page of a run: tables, pictures, and what so few pairs cannot show."""
from collections.abc import Sequence
import json
import math
from pathlib import Path

from ...core.common.settings import InputError
from ..report import markdown
from . import plots
from .front_end import Features
from .front_end import shared_matches
from .front_end import Variant
from .record import Record
from .run import Entry
from .studies import STUDIES
from .tables import latex
from .tables import main_rows
from .tables import variant_rows
from .tables import whole
from .task import Protocol

PICTURED = 4
"""Methods of the picture of matches."""
Z = 1.96
"""Of a 95 % interval."""


def write(folder: Path, records: Sequence[Record], protocol: Protocol, entries: Sequence[Entry],
          study: str, features: Features | None) -> str:
    """Write ``results.md``, ``table.tex`` and the pictures of a run; return the tables."""
    first = protocol.thresholds[0]
    if study:
        axis = STUDIES[study][0]
        header, rows = variant_rows(records, first)
        text = f'{axis}\n\n{markdown(header, rows)}'
        plots.recall_along(folder / 'study.png', records, first, axis)
        pictures = ['study.png']
    else:
        header, rows = main_rows(records, protocol, first)
        text = whole(records, protocol)
        plots.errors(folder / 'errors.png', records, first)
        pictures = ['errors.png', *_matches(folder, protocol, entries, features)]
    pairs = len({r.task for r in records})
    setup = json.loads((folder / 'setup.json').read_text())
    (folder / 'table.tex').write_text(latex(header, rows) + '\n')
    lines = [f'# {protocol.name}', text, _caution(pairs),
             *(f'![{picture}]({picture})' for picture in pictures),
             f'Commit {setup["revision"]}; settings and versions in setup.json, all pairs in '
             'pairs.csv.']
    (folder / 'results.md').write_text('\n\n'.join(lines) + '\n')
    return text


def _matches(folder: Path, protocol: Protocol, entries: Sequence[Entry],
             features: Features | None) -> list[str]:
    """Draw the matches of the pair in the middle, before and after some of the methods."""
    task = protocol.tasks[len(protocol.tasks) // 2]
    try:
        given = shared_matches(task, protocol.front_end, protocol.inlier_m, Variant(), features)
    except InputError:
        return []
    solutions = {entry.name: entry.method(given)
                 for entry in entries if entry.method is not None and entry.front_end is None}
    chosen = dict(list(solutions.items())[:PICTURED])
    if not chosen:
        return []
    plots.matches_before_and_after(folder / 'matches.png', task, given, chosen)
    return ['matches.png']


def _caution(pairs: int) -> str:
    """Return what so many pairs can tell: the interval (Wilson) of a method that is always right.

    Whatever share is printed, its interval is at least as wide.
    """
    low = pairs / (pairs + Z**2)
    half = 50 * Z / math.sqrt(pairs)
    return (f'With {pairs} pair{"s" if pairs > 1 else ""}, all of them right is compatible (95 %) '
            f'with a recall of {100 * low:.0f} %, and a recall about one half is known to '
            f'{half:.0f} points: differences below that say nothing.')
