"""Standard output and error that may be gone: a closed pipe, a full disk, a service."""
from collections.abc import Iterator
from contextlib import contextmanager
import os
import sys


def fill_gaps() -> None:
    """Let what is printed go nowhere where a stream was closed before the start."""
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, 'w'))    # noqa: SIM115


def forget() -> None:
    """Give up what cannot be written, so that the end of the process does not try it again."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def not_needed() -> Iterator[None]:
    """Print what nobody has to read: that it cannot be written is no error."""
    try:
        yield
    except OSError:
        pass
    finally:
        forget()
