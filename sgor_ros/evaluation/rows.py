"""A row of results, what one method made of one pair, and its CSV files."""
from collections.abc import Iterable
import csv
from dataclasses import dataclass
from dataclasses import fields
import io
from pathlib import Path

from ..core.common.settings import InputError
from .metrics.registration import EASY
from .metrics.registration import Threshold

NAN = float('nan')


@dataclass(frozen=True)
class Row:
    """One method on one pair.

    Attributes
    ----------
    method, pair, group : str
    rotation_error_deg, translation_error_m : float
        RE and TE; NaN without an answer or a truth.
    seconds : float
        From two raw scans on; for methods on matches from these on.
    variant : str
        What a study changed, empty without one.
    source, target : str
        Names of the scans.
    same_place : bool
        Whether there is something to find.
    distance_m : float
        Of the sensors.
    accepted : bool
        Whether the method itself trusts its answer.
    score : float
        By what it judged.
    seconds_one_new : float
        With one of the scans prepared before.
    cpu_seconds : float
        Of the call, all threads together.
    confidence, degenerate, alternatives, nees : float, int, int, float
        Of SGOR alone: confidence, count of degenerate directions and of alternatives, and the
        squared error normalised by the covariance.
    matches : int
        How many it was given.
    inlier_share : float
        Of those; NaN where it was given none.
    precision, recall, f1 : float
        IP, IR and F1 of the matches that it kept, 0 to 1; NaN where it was given none.
    """

    method: str
    pair: str
    group: str
    rotation_error_deg: float
    translation_error_m: float
    seconds: float
    variant: str = ''
    source: str = ''
    target: str = ''
    same_place: bool = True
    distance_m: float = NAN
    accepted: bool = True
    score: float = NAN
    seconds_one_new: float = NAN
    cpu_seconds: float = NAN
    confidence: float = NAN
    degenerate: int = 0
    alternatives: int = 0
    nees: float = NAN
    matches: int = 0
    inlier_share: float = NAN
    precision: float = NAN
    recall: float = NAN
    f1: float = NAN

    def within(self, threshold: Threshold) -> bool:
        """Return whether the errors are below a threshold."""
        return (self.rotation_error_deg < threshold.rotation_deg
                and self.translation_error_m < threshold.translation_m)

    @property
    def correct(self) -> bool:
        """Whether the errors are below the strict thresholds of KITTI, trusted or not."""
        return self.within(EASY)

    @property
    def success(self) -> bool:
        """Whether there is a correct answer that the method accepts."""
        return self.accepted and self.correct

    @property
    def false_accept(self) -> bool:
        """Whether the method accepts a wrong answer."""
        return self.accepted and not self.correct


BENCHMARK = {
    'method': 'method', 'data_set': 'group', 'source': 'source', 'target': 'target',
    'right': 'same_place', 'distance_m': 'distance_m',
    'rotation_error_deg': 'rotation_error_deg', 'translation_error_m': 'translation_error_m',
    'within': 'correct', 'valid': 'accepted', 'score': 'score', 'seconds': 'seconds',
    'seconds_one_new': 'seconds_one_new', 'confidence': 'confidence', 'degenerate': 'degenerate',
    'alternatives': 'alternatives', 'nees': 'nees'}
"""Columns of ``rows.csv`` of `sgor_benchmark` and what of a row they hold."""

TABLES = {
    'method': 'method', 'variant': 'variant', 'task': 'pair', 'group': 'group',
    'rotation_deg': 'rotation_error_deg', 'translation_m': 'translation_error_m',
    'precision': 'precision', 'recall': 'recall', 'f1': 'f1', 'matches': 'matches',
    'right_share': 'inlier_share', 'seconds': 'seconds'}
"""Columns of ``pairs.csv`` of `sgor_tables`, from which a run is resumed."""

TABLES_HEADER = ','.join(TABLES) + '\n'


def records(rows: Iterable[Row]) -> list[dict[str, object]]:
    """Return what ``rows.csv`` gets."""
    return [{column: getattr(row, name) for column, name in BENCHMARK.items()} for row in rows]


def lines(rows: Iterable[Row]) -> str:
    """Return lines of ``pairs.csv``, without the header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    for row in rows:
        values = [getattr(row, name) for name in TABLES.values()]
        # whole, so that a table made from the file is the same
        writer.writerow([repr(value) if isinstance(value, float) else value for value in values])
    return text.getvalue()


def read(path: Path) -> list[Row]:
    """Read a ``pairs.csv``; a last line that was cut off is left out.

    Raises
    ------
    InputError
        It is another kind of file.
    """
    if not path.is_file():
        return []
    text = path.read_text()
    whole = text[:text.rfind('\n') + 1]
    if not whole.startswith(TABLES_HEADER):
        raise InputError(f'{path}: its first line is not {TABLES_HEADER.strip()}')
    kinds = {item.name: item.type for item in fields(Row)}
    return [Row(**{name: kinds[name](line[column]) for column, name in TABLES.items()})    # type: ignore[operator]
            for line in csv.DictReader(whole.splitlines())]
