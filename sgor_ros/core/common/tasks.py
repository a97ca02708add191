"""Tasks that run at once, as far as there are cores."""
from collections.abc import Callable
from typing import Any

from .threads import cores
from .threads import shared


def at_once(threads: int, *tasks: Callable[[], Any]) -> list[Any]:
    """Run tasks on up to so many threads; return what they return, in their order."""
    found: list[Any] = [None] * len(tasks)

    def run(first: int, last: int) -> None:
        # what is allowed is said anew: each thread of the pool has a limit of its own
        with cores(threads):
            for k in range(first, last):
                found[k] = tasks[k]()

    shared(run, len(tasks))
    return found
