"""What a person at a terminal sees of long work and of tables; logs and pipes get plain text."""
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
import os
import sys
import time
from typing import TextIO

from rich.console import Console
from rich.measure import Measurement
from rich.progress import BarColumn
from rich.progress import MofNCompleteColumn
from rich.progress import Progress as RichProgress
from rich.progress import TextColumn
from rich.progress import TimeElapsedColumn
from rich.progress import TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from . import standard_streams

LINE_S = 30.0
"""Between two lines of progress where there is no terminal."""
REFRESH_S = 0.1


class Progress:
    """Counts steps, and tells of them in a bar or, now and then, in a line; both on stderr.

    Parameters
    ----------
    title : str
    total : int or None
        None where nobody knows.
    unit : str
        A step in one word, such as ``'scan'``.
    bar : rich.progress.Progress or None
    """

    def __init__(self, title: str, total: int | None, unit: str, bar: RichProgress | None) -> None:
        self._title, self._total, self._unit, self._bar = title, total, unit, bar
        self._done = 0
        self._begin = self._told = time.monotonic()
        if bar is not None:
            self._task = bar.add_task(title, total=total, unit=unit)
            bar.refresh()

    def over[T](self, items: Iterable[T]) -> Iterator[T]:
        """Yield the items, each of them a step."""
        for item in items:
            yield item
            self.step()

    def step(self) -> None:
        """Count one more."""
        self._done += 1
        now = time.monotonic()
        if self._bar is not None:
            self._bar.advance(self._task)
            # no thread of its own, which would take time from what is measured
            if now - self._told >= REFRESH_S or self._done == self._total:
                self._told = now
                self._bar.refresh()
        elif now - self._told >= LINE_S:
            self._told = now
            with standard_streams.not_needed():
                print(self._line(now - self._begin), file=sys.stderr)

    def _line(self, seconds: float) -> str:
        title = f'{self._title}: ' if self._title else ''
        if not self._total:
            return f'{title}{self._done} {self._unit}s in {_minutes(seconds)} min'
        left = seconds * max(self._total - self._done, 0) / self._done
        return (f'{title}{self._done} of {self._total} {self._unit}s in {_minutes(seconds)} min, '
                f'{_minutes(left)} min left')


@contextmanager
def progress(title: str, total: int | None, unit: str) -> Iterator[Progress]:
    """Yield what counts the steps of long work; see `Progress`."""
    if not _is_screen(sys.stderr):
        yield Progress(title, total, unit, None)
        return
    columns = (TextColumn('{task.description}', markup=False), BarColumn(), MofNCompleteColumn(),
               TextColumn('{task.fields[unit]}s', markup=False), TimeElapsedColumn(),
               TextColumn('left'), TimeRemainingColumn())
    with RichProgress(*columns, console=Console(stderr=True), auto_refresh=False,
                      redirect_stdout=False) as bar:
        yield Progress(title, total, unit, bar)


def show(text: str) -> None:
    """Print Markdown; on a terminal its tables are drawn to fit."""
    if not _is_screen(sys.stdout):
        print(text)
        return
    console = Console()
    for block in text.split('\n\n'):
        lines = block.split('\n')
        if len(lines) > 1 and all(line.startswith('| ') for line in lines):
            header, _, *rows = ([cell.strip() for cell in line.strip('|').split('|')]
                                for line in lines)
            console.print(_fitting(console, header, rows))
        else:
            console.print(Text(block))
        console.print()


def _fitting(console: Console, header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table; with a column for each row, where it would be too wide and that helps."""
    table = _table(header, rows)
    if _width(console, table) <= console.width:
        return table
    first, *others = zip(header, *rows, strict=True)
    turned = _table(first, others)
    return turned if _width(console, turned) < _width(console, table) else table


def _width(console: Console, table: Table) -> int:
    """Return how wide a table is where no cell is folded."""
    return Measurement.get(console, console.options.update(max_width=10_000), table).maximum


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    table = Table()
    for index, name in enumerate(header):
        table.add_column(Text(name), justify='right' if index else 'left')
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def _is_screen(stream: TextIO) -> bool:
    # rich alone would also believe FORCE_COLOR, which is set where logs are read
    return stream.isatty() and os.environ.get('TERM', 'dumb') not in ('dumb', 'unknown')


def _minutes(seconds: float) -> str:
    return f'{int(seconds) // 60}:{int(seconds) % 60:02d}'
