"""Warnings that tell everything and still leave the log readable at ten scans a second."""
import re
import time
from typing import Any

PERIOD_S = 2.0
REMEMBERED = 1000


class SparingLog:
    """Passes warnings on to a logger of rclpy, leaving out repetitions."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._last: dict[str, float] = {}

    def once(self, text: str) -> None:
        """Warn unless the same text was passed on before."""
        self._warn(text, text, float('inf'))

    def seldom(self, text: str) -> None:
        """Warn unless a text that differs only in its numbers was passed on just before."""
        self._warn(text, re.sub(r'\d+', '#', text), PERIOD_S)

    def _warn(self, text: str, key: str, period_s: float) -> None:
        now = time.monotonic()
        if now - self._last.get(key, float('-inf')) < period_s:
            return
        if len(self._last) >= REMEMBERED:
            self._last.clear()
        self._last[key] = now
        self._logger.warning(text)
