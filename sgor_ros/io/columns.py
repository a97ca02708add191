"""The columns of .pcd and .ply: what a header claims, held against the bytes that are there."""
from collections.abc import Sequence
from dataclasses import dataclass
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.common.settings import InputError

Columns = list[tuple[str, NDArray[Any]]]
"""Name and (N,) values of each field that has one value a point."""

MOST_BYTES_A_POINT = 1 << 16
"""No driver writes that many; without a bound `COUNT` of a broken header is one."""


@dataclass(frozen=True)
class Field:
    """One field of a point.

    Attributes
    ----------
    name : str
    code : str
        Its type for numpy, with the byte order: ``'<f4'``.
    count : int
        Values of it that a point has.
    """

    name: str
    code: str
    count: int = 1

    @property
    def size(self) -> int:
        """Bytes a point."""
        return np.dtype(self.code).itemsize * self.count


def bytes_a_point(fields: Sequence[Field]) -> int:
    """Return how many bytes the fields of one point take.

    Raises
    ------
    InputError
        None, or more than any point has.
    """
    step = sum(field.size for field in fields)
    if not 0 < step <= MOST_BYTES_A_POINT:
        raise InputError(f'its header tells of {step} bytes a point')
    return step


def binary_columns(fields: Sequence[Field], points: int, data: bytes | memoryview) -> Columns:
    """Return the columns of points that lie one after the other.

    Raises
    ------
    InputError
        Fewer bytes than the header claims.
    """
    step = bytes_a_point(fields)
    _check_bytes(points, step, len(data))
    columns, offset = [], 0
    for field in fields:
        if field.count == 1:
            columns.append((field.name, np.ndarray(
                (points,), field.code, data, offset, (step,))))
        offset += field.size
    return columns


def field_by_field(fields: Sequence[Field], points: int, data: bytes) -> Columns:
    """Return the columns of fields that lie one after the other, as in compressed .pcd.

    Raises
    ------
    InputError
        Fewer bytes than the header claims.
    """
    _check_bytes(points, bytes_a_point(fields), len(data))
    columns, offset = [], 0
    for field in fields:
        if field.count == 1:
            columns.append((field.name, np.ndarray((points,), field.code, data, offset)))
        offset += field.size * points
    return columns


def ascii_columns(fields: Sequence[Field], points: int, text: bytes) -> Columns:
    """Return the columns of points that are written as numbers, one a line.

    Raises
    ------
    InputError
        Another number of lines or of columns than the header claims, or what is no number.
    """
    bytes_a_point(fields)
    width = sum(field.count for field in fields)
    if points * (2 * width - 1) > len(text):
        raise InputError(f'{len(text)} bytes are fewer than the {points} rows of {width} numbers '
                         'that its header tells; truncated')
    values = np.empty((0, width))
    if text.strip():
        try:
            values = np.loadtxt(io.BytesIO(text), np.float64, comments=None, ndmin=2)
        except ValueError as error:
            raise InputError(f'not {width} numbers in each row: {error}') from error
    if values.shape != (points, width):
        raise InputError(f'{values.shape[0]} rows of {values.shape[1]} numbers, but its header '
                         f'tells of {points} rows of {width}; truncated')
    columns, at = [], 0
    for field in fields:
        if field.count == 1:
            columns.append((field.name, values[:, at]))
        at += field.count
    return columns


def _check_bytes(points: int, step: int, there: int) -> None:
    if points * step > there:
        raise InputError(f'{there} bytes are fewer than the {points} points of {step} bytes that '
                         'its header tells; truncated')
