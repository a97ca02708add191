"""What one method made of one pair: one row, of which each command writes the columns it has."""
from collections.abc import Iterable
import csv
from dataclasses import dataclass
from dataclasses import fields
from dataclasses import replace
import io
from pathlib import Path
from typing import Any

from ...core.common.settings import InputError

NAN = float('nan')


@dataclass(frozen=True)
class Threshold:
    """Within both an answer is right: degrees and metres."""

    name: str
    rotation_deg: float
    translation_m: float


@dataclass(frozen=True, kw_only=True)
class Row:
    """One method on one pair; RE in degrees, TE in metres, NaN without an answer.

    Attributes
    ----------
    method : str
    pair, group, variant : str
        Name of the pair, what it is counted under, and what a study changed.
    data_set, source, target : str
    right : bool
        Whether both scans are of one place.
    within : bool
        Whether the answer is within the first threshold of the protocol.
    valid : bool
        Whether the method itself trusts its answer.
    score : float
        By what it judged: confidence, inliers or fitness.
    seconds, seconds_one_new : float
        From what the method was given to the transformation; with one scan prepared before.
    confidence, degenerate, alternatives, nees
        Of SGOR alone: confidence, count of degenerate directions and of alternatives, and the
        error measured by the covariance.
    precision, recall, f1 : float
        IP, IR and F1 of the matches kept, 0 to 1; NaN on raw scans.
    matches : int
    right_share : float
        Of the matches that it was given; NaN on raw scans.
    """

    method: str
    pair: str = ''
    group: str = ''
    variant: str = ''
    data_set: str = ''
    source: str = ''
    target: str = ''
    right: bool = True
    distance_m: float = NAN
    rotation_error_deg: float
    translation_error_m: float
    within: bool
    valid: bool = True
    score: float = NAN
    seconds: float
    seconds_one_new: float = NAN
    confidence: float = NAN
    degenerate: int = 0
    alternatives: int = 0
    nees: float = NAN
    precision: float = NAN
    recall: float = NAN
    f1: float = NAN
    matches: int = 0
    right_share: float = NAN

    @property
    def success(self) -> bool:
        """Whether there is a right answer that the method stands by."""
        return self.valid and self.within

    @property
    def false_accept(self) -> bool:
        """Whether the method stands by a wrong answer."""
        return self.valid and not self.within

    def below(self, threshold: Threshold) -> bool:
        """Return whether both errors are below a threshold."""
        return (self.rotation_error_deg < threshold.rotation_deg
                and self.translation_error_m < threshold.translation_m)


SCAN_COLUMNS = ('method', 'data_set', 'source', 'target', 'right', 'distance_m',
                'rotation_error_deg', 'translation_error_m', 'within', 'valid', 'score', 'seconds',
                'seconds_one_new', 'confidence', 'degenerate', 'alternatives', 'nees')
"""Of ``rows.csv`` of `sgor_benchmark`."""

MATCH_COLUMNS = {
    'method': 'method', 'variant': 'variant', 'task': 'pair', 'group': 'group',
    'rotation_deg': 'rotation_error_deg', 'translation_m': 'translation_error_m',
    'precision': 'precision', 'recall': 'recall', 'f1': 'f1', 'matches': 'matches',
    'right_share': 'right_share', 'seconds': 'seconds'}
"""Columns of ``pairs.csv`` of `sgor_tables`, each with its field."""


def scan_records(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return what ``rows.csv`` holds of each row."""
    return [{name: getattr(row, name) for name in SCAN_COLUMNS} for row in rows]


def lines(rows: Iterable[Row]) -> str:
    """Return rows of ``pairs.csv``, without a header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    for row in rows:
        values = [getattr(row, name) for name in MATCH_COLUMNS.values()]
        # whole, so that a table made from the file is the same
        writer.writerow(repr(v) if isinstance(v, float) else v for v in values)
    return text.getvalue()


def read(path: Path, threshold: Threshold) -> list[Row]:
    """Read a ``pairs.csv``; a last line that was cut off is left out.

    Raises
    ------
    InputError
        It is another kind of file.
    """
    if not path.is_file():
        return []
    text = path.read_text()
    header, *whole = text[:text.rfind('\n') + 1].splitlines() or ['']
    if header.split(',') != list(MATCH_COLUMNS):
        raise InputError(f'{path}: its first line is not {",".join(MATCH_COLUMNS)}')
    kinds = {item.name: item.type for item in fields(Row)}
    found = []
    for values in csv.reader(whole):
        named = zip(MATCH_COLUMNS.values(), values, strict=True)
        # types of a dataclass are classes here, as annotations are not postponed
        row = Row(within=False, **{name: kinds[name](value) for name, value in named})    # type: ignore[operator]
        found.append(replace(row, within=row.below(threshold)))
    return found
