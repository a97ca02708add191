"""Two tasks that run at once, where there are cores for it."""
from collections.abc import Callable

from .threads import cores
from .threads import parallel_for


def run_both[A, B](threads: int, one: Callable[[], A], other: Callable[[], B]) -> tuple[A, B]:
    """Run two tasks, each on up to half of so many threads; return what they return."""
    first: list[A] = []
    second: list[B] = []

    def run(begin: int, end: int) -> None:
        # each thread of the pool has a limit of its own
        with cores(max(threads // 2, 1)):
            if begin == 0:
                first.append(one())
            if end == 2:
                second.append(other())

    parallel_for(run, 2)
    return first[0], second[0]
