"""Numbers of the command line, checked as they are read."""
from argparse import ArgumentTypeError


def count(text: str) -> int:
    """Return a whole number from 0."""
    if not text.isdecimal():
        raise ArgumentTypeError(f'{text!r}: expected a whole number')
    return int(text)


def positive(text: str) -> int:
    """Return a whole number from 1."""
    if count(text) == 0:
        raise ArgumentTypeError(f'{text!r}: expected a whole number from 1')
    return int(text)


def share(text: str) -> float:
    """Return a number from 0 to 1."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1:
        raise ArgumentTypeError(f'{text!r}: expected a number from 0 to 1')
    return value
