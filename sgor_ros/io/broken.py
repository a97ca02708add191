"""Parsers of bytes that are not what they should be: whatever they raise, it is one error."""
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..core.common.settings import InputError

WORDS = 200
"""Characters of what a parser says; some repeat the file."""


@contextmanager
def readable(what: Path | str, advice: str = '') -> Iterator[None]:
    """Turn what a parser of broken bytes raises, which can be anything, into one error.

    Parameters
    ----------
    what : str or Path
        What is read, the subject of the message.
    advice : str
        What to do about it.

    Raises
    ------
    InputError
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        said = ('it claims to be larger than the memory' if isinstance(error, MemoryError)
                else str(error)[:WORDS] or type(error).__name__)
        raise InputError(f'{what}: cannot be read: {said}'
                         + (f'; {advice}' if advice else '')) from error
