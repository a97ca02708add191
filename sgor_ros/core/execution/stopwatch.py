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
        # a stage that several attempts go through adds up
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start
