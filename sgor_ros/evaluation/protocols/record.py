"""What one method made of one pair, as a row of a CSV file."""
from collections.abc import Iterable
from collections.abc import Sequence
import csv
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import fields
import io
from pathlib import Path

from ...core.common.settings import InputError
from .task import Threshold


@dataclass(frozen=True)
class Record:
    """One method on one pair.

    Attributes
    ----------
    method, variant, task, group : str
        `variant` is what a study changed, empty without one.
    rotation_deg, translation_m : float
        RE and TE; NaN without an answer.
    precision, recall, f1 : float
        IP, IR and F1 of the matches kept, 0 to 1; NaN where it was given none.
    matches : int
    right_share : float
        Of the matches that it was given; NaN where it was given none.
    seconds : float
        From the matches on; for methods on raw scans from these on.
    """

    method: str
    variant: str
    task: str
    group: str
    rotation_deg: float
    translation_m: float
    precision: float
    recall: float
    f1: float
    matches: int
    right_share: float
    seconds: float

    def within(self, threshold: Threshold) -> bool:
        """Return whether the answer is right."""
        return (self.rotation_deg < threshold.rotation_deg
                and self.translation_m < threshold.translation_m)


COLUMNS = [item.name for item in fields(Record)]
TIMES = ('seconds',)
"""Columns that differ from run to run."""


def lines(records: Iterable[Record]) -> str:
    """Return rows of CSV, without a header."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator='\n')
    for record in records:
        row = asdict(record)
        # whole, so that a table made from the file is the same
        writer.writerow({name: repr(value) if isinstance(value, float) else value
                         for name, value in row.items()})
    return text.getvalue()


def read(path: Path) -> list[Record]:
    """Read what a run has written; a last line that was cut off is left out.

    Raises
    ------
    InputError
        It is another kind of file.
    """
    if not path.is_file():
        return []
    text = path.read_text()
    whole = text[:text.rfind('\n') + 1].splitlines()
    if not whole or whole[0].split(',') != COLUMNS:
        raise InputError(f'{path}: its first line is not {",".join(COLUMNS)}')
    kinds = {item.name: item.type for item in fields(Record)}
    make = {'str': str, 'int': int, 'float': float}
    found: Sequence[dict[str, str]] = list(csv.DictReader(whole))
    return [Record(**{name: make[str(getattr(kinds[name], '__name__', kinds[name]))](value)
                      for name, value in row.items()}) for row in found]
