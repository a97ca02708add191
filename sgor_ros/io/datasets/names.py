"""What the names of scans tell: their order, their times, and which of them are missing."""
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
import re

import numpy as np
from numpy.typing import NDArray

from ...core.common.settings import InputError
from ..scans import BIN_COLUMNS

FASTEST_NS = 1_000_000
"""Scans are at least a millisecond apart: numbers closer than that count them."""

DECIMAL = re.compile(r'(\D*)(\d+(?:\.\d+)?(?:e[+-]?\d+)?)')
PARTS = re.compile(r'(\d+)[_-](\d{1,9})')
EPOCH_DIGITS = 9
"""Seconds since 1970 have so many digits or one more."""


def in_order(paths: Sequence[Path]) -> list[Path]:
    """Return files in the order of the numbers in their names: 2 before 10, 0.05 before 0.4."""
    if _are_decimal(paths):
        return sorted(paths, key=lambda path: (*_decimal(path), path.name))
    return sorted(paths, key=lambda path: [
        (0, int(part), '') if part.isdecimal() else (1, 0, part)
        for part in re.split(r'([0-9]+)', path.name) if part])


def stamps_of_names(scans: Sequence[Path]) -> NDArray[np.int64] | None:
    """Return the stamps of scans, nanoseconds, that are named by them; None where they are not.

    Names are nanoseconds, microseconds or milliseconds of 19, 16 and 13 digits, seconds with a
    decimal point, or seconds and nanoseconds with ``_`` or ``-`` between them.
    """
    stems = [_stem(scan) for scan in scans]
    stamps = _whole(stems) or _in_parts(stems)
    if _are_decimal(scans) and not any(_decimal(scan)[0] for scan in scans):
        stamps = [int(_decimal(scan)[1] * 10**9) for scan in scans]
    if stamps is None or max(stamps) >= 2**63:
        return None
    return increasing(stamps, scans[0].parent, scans)


def missing_numbers(names: Sequence[str]) -> tuple[str, ...]:
    """Return a warning where the numbers at the ends of names without times jump."""
    found = [re.findall(r'\d+', name.rpartition('/')[2]) for name in names]
    numbers = [int(each[-1]) for each in found if each]
    if len(numbers) != len(names) or len(numbers) < 3:
        return ()
    steps = np.diff(np.array(numbers, np.float64))
    usual = float(np.median(steps))
    jumps = np.flatnonzero(steps > 1.5 * usual)
    if usual <= 0 or not jumps.size:
        return ()
    widest = int(jumps[steps[jumps].argmax()])
    more = f' and {jumps.size - 1} times more' if jumps.size > 1 else ''
    return (f'the numbers of the scans jump from {names[widest]} to {names[widest + 1]}{more}: '
            'some are missing, and without times their neighbours count as 0.1 s apart',)


def increasing(stamps_ns: Sequence[int], where: Path, scans: Sequence[Path]) -> NDArray[np.int64]:
    """Return the stamps as an array, if each is later than the one before.

    Raises
    ------
    InputError
        They are not.
    """
    stamps = np.array(stamps_ns, np.int64)
    back = np.flatnonzero(np.diff(stamps) <= 0)
    if back.size:
        raise InputError(f'{where}: the time of {scans[back[0] + 1].name} is not after that of '
                         f'{scans[back[0]].name}')
    return stamps


def _stem(path: Path) -> str:
    name = path.name
    ending = next((each for each in BIN_COLUMNS if name.endswith(each)), path.suffix)
    return name.removesuffix(ending)


def _are_decimal(paths: Sequence[Path]) -> bool:
    """Return whether all names are numbers behind the same text, some with a decimal point."""
    found = [DECIMAL.fullmatch(_stem(path)) for path in paths]
    return (all(found) and any(not each[2].isdecimal() for each in found if each)
            and len({each[1] for each in found if each}) == 1)


def _decimal(path: Path) -> tuple[str, Decimal]:
    found = DECIMAL.fullmatch(_stem(path))
    assert found is not None, 'all names are such'
    return found[1], Decimal(found[2])


def _whole(stems: Sequence[str]) -> list[int] | None:
    """Return the stamps of names of digits alone, in the unit that their digits tell."""
    if not all(stem.isdecimal() for stem in stems):
        return None
    numbers, digits = [int(stem) for stem in stems], min(map(len, stems))
    if digits == 13 and numbers[0] >= 10**12:
        return [number * 10**6 for number in numbers]
    if digits < 16:
        return None
    step = float(np.median(np.diff(np.array(numbers, np.float64)))) if len(numbers) > 1 else None
    for unit in (1, 1000):
        if step is None or step * unit >= FASTEST_NS:
            return [number * unit for number in numbers]
    return None


def _in_parts(stems: Sequence[str]) -> list[int] | None:
    """Return the stamps of names of seconds and nanoseconds, padded with zeros or not."""
    found = [PARTS.fullmatch(stem) for stem in stems]
    parts = [(each[1], each[2]) for each in found if each]
    if len(parts) != len(stems):
        return None
    dated = all(EPOCH_DIGITS <= len(seconds) <= EPOCH_DIGITS + 1 for seconds, _ in parts)
    if not dated and not all(len(rest) == 9 for _, rest in parts):
        return None
    return [int(seconds) * 10**9 + int(rest) for seconds, rest in parts]
