"""The results page of a run: tables, pictures, and what so few pairs cannot show."""
from collections.abc import Sequence
import json
import math
from pathlib import Path

from ...core.common.settings import InputError
from ...io.writing import free_folder
from ..front_end import Features
from ..front_end import shared_matches
from ..methods import Method
from ..metrics.row import Row
from ..protocols.protocol import Protocol
from ..protocols.studies import STUDIES
from ..protocols.studies import Variant
from . import protocol_plots as plots
from .protocol_tables import latex
from .protocol_tables import main_rows
from .protocol_tables import variant_rows
from .protocol_tables import whole
from .tables import markdown

CONTENT = 'page.json'
PAGE = ('results.md', 'table.tex')

PICTURED = 4
"""Methods of the picture of matches."""
Z = 1.96
"""Of a 95 % interval."""


def keep_earlier(folder: Path, measured: Sequence[Row]) -> str:
    """Move the page of other pairs or methods into a folder of its own, and return what is told.

    What the page is of is in ``page.json``; the rows of all pairs stay in ``pairs.csv``.
    """
    path, now = folder / CONTENT, _content(measured)
    if path.is_file():
        before = json.loads(path.read_text())
    else:    # of older versions nobody knows what they are of
        before = {} if (folder / PAGE[0]).is_file() else now
    path.write_text(json.dumps(now, indent=1) + '\n')
    if before == now:
        return ''
    earlier = free_folder(folder / 'earlier')
    earlier.mkdir()
    for file in sorted(folder.iterdir()):
        if file.name in PAGE or file.suffix == '.png':
            file.rename(earlier / file.name)
    told = [', '.join(f'{len(value)} {key}' for key, value in of.items()) or 'an older version'
            for of in (before, now)]
    return (f'{folder}: the table there was of {told[0]}, this one is of {told[1]}: that one is '
            f'in {earlier} now')


def _content(measured: Sequence[Row]) -> dict[str, list[str]]:
    return {name: list(dict.fromkeys(getattr(row, name.removesuffix('s')) for row in measured))
            for name in ('pairs', 'methods', 'variants')}


def write(folder: Path, measured: Sequence[Row], protocol: Protocol, methods: Sequence[Method],
          study: str, features: Features | None) -> str:
    """Write ``results.md``, ``table.tex`` and the pictures of a run; return the tables."""
    first = protocol.thresholds[0]
    if study:
        axis = STUDIES[study][0]
        header, rows = variant_rows(measured, first)
        text = f'{axis}\n\n{markdown(header, rows)}'
        plots.recall_along(folder / 'study.png', measured, first, axis)
        pictures = ['study.png']
    else:
        header, rows = main_rows(measured, protocol, first)
        text = whole(measured, protocol)
        plots.errors(folder / 'errors.png', measured, first)
        pictures = ['errors.png', *_matches(folder, protocol, methods, features)]
    pairs = len({r.pair for r in measured})
    setup = json.loads((folder / 'setup.json').read_text())
    (folder / 'table.tex').write_text(latex(header, rows) + '\n')
    lines = [f'# {protocol.name}', text, _caution(pairs),
             *(f'![{picture}]({picture})' for picture in pictures),
             f'Commit {setup["revision"]}; settings and versions in setup.json, all pairs in '
             'pairs.csv.']
    (folder / 'results.md').write_text('\n\n'.join(lines) + '\n')
    return text


def _matches(folder: Path, protocol: Protocol, methods: Sequence[Method],
             features: Features | None) -> list[str]:
    """Draw the matches of the pair in the middle, before and after some of the methods."""
    pair = protocol.pairs[len(protocol.pairs) // 2]
    assert pair.T_target_source is not None
    try:
        given = shared_matches(pair, protocol.front_end, protocol.inlier_m, Variant(), features)
    except InputError:
        return []
    answers = {method.name: method.on_matches(given) for method in methods
               if method.on_matches is not None and method.front_end is None}
    chosen = dict(list(answers.items())[:PICTURED])
    if not chosen:
        return []
    plots.matches_before_and_after(folder / 'matches.png', pair.T_target_source, given, chosen)
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
