"""Lazy values: made when they are first asked for."""
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Any


class Lazy[Thing]:
    """Something that takes time to make, and is not always needed."""

    def __init__(self, make: Callable[[], Thing]) -> None:
        self._make: Callable[[], Thing] | None = make
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what is made, not what it is made from."""
        return _made, (self(),)

    def __call__(self) -> Thing:
        """Return it; the first call makes it."""
        with self._lock:
            if self._make is not None:
                self._thing = self._make()
                self._make = None    # and let go of what it was made from
            return self._thing


def _made[Thing](thing: Thing) -> Lazy[Thing]:
    return Lazy(partial(_same, thing))


def _same[Thing](thing: Thing) -> Thing:
    return thing
