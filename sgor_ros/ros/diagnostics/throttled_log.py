"""A log that leaves repetitions out, readable at ten scans a second."""
from collections.abc import Iterator
from contextlib import contextmanager
import logging
import re
import time
from typing import Any

PERIOD_S = 2.0
REMEMBERED = 1000
# a number, or a list of them
NUMBERS = re.compile(r'\d+(?:[.,\s]*\d+)*')


class _Forward(logging.Handler):
    def __init__(self, logger: Any) -> None:
        super().__init__()
        self._logger = logger

    def emit(self, record: logging.LogRecord) -> None:
        self._logger.warning(record.getMessage())


@contextmanager
def forwarded(logger: Any) -> Iterator[None]:
    """Pass on to a logger of rclpy what the library says meanwhile."""
    forward = _Forward(logger)
    library = logging.getLogger('sgor_ros')
    library.addHandler(forward)
    try:
        yield
    finally:
        library.removeHandler(forward)


class ThrottledLog:
    """Passes texts on to a logger of rclpy, leaving out repetitions."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._last: dict[str, float] = {}
        self._trouble = ''

    def info_once(self, text: str) -> None:
        """Inform, unless the text is empty or was passed on before."""
        if text and self._is_due(text, float('inf')):
            self._logger.info(text)

    def warn_once(self, text: str) -> None:
        """Warn unless the same text was passed on before."""
        if self._is_due(text, float('inf')):
            self._logger.warning(text)

    def warn_on_change(self, text: str, where: str) -> None:
        """Warn when the text changes: trouble begins, changes or, with an empty text, ends.

        What differs only in its numbers is the same trouble; trouble that comes and goes is told
        again after `PERIOD_S`.

        Parameters
        ----------
        text : str
        where : str
            Goes before the text; it is no part of it.
        """
        kind = NUMBERS.sub('#', text)
        if kind == self._trouble:
            return
        self._trouble = kind
        if not text:
            text = 'all is well again'
        if self._is_due(f'trouble: {kind}', PERIOD_S):
            self._logger.warning(f'{where}: {text}')

    def _is_due(self, key: str, period_s: float) -> bool:
        now = time.monotonic()
        if now - self._last.get(key, float('-inf')) < period_s:
            return False
        if len(self._last) >= REMEMBERED:
            self._last.clear()
        self._last[key] = now
        return True
