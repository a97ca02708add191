"""Seconds by stage, for the `timings` of results."""
from collections.abc import Iterator
from contextlib import contextmanager
import time


class Stopwatch:
    """Collects how long named stages took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time what is done inside the ``with``."""
        start = time.perf_counter()
        yield
        self.seconds[stage] = time.perf_counter() - start
