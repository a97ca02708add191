"""Scans that never came: the middleware drops them silently, gaps between stamps show it."""
from collections import deque
from statistics import median

# enough to know the period of the sensor, and soon forgotten when it changes
REMEMBERED = 20
NEEDED = 5
# a longer silence is a sensor that stood still, not scans that were lost
LONGEST_GAP = 50


class StampGaps:
    """Counts the scans that are missing between stamps at an otherwise steady distance."""

    def __init__(self) -> None:
        self.missed = 0
        self._last_ns: int | None = None
        self._steps: deque[int] = deque(maxlen=REMEMBERED)

    def take(self, stamp_ns: int) -> None:
        """Note the stamp of a scan that came."""
        last, self._last_ns = self._last_ns, stamp_ns
        if last is None or stamp_ns <= last:
            return
        step = stamp_ns - last
        if len(self._steps) >= NEEDED:
            missing = round(step / median(self._steps)) - 1
            if missing < LONGEST_GAP:
                self.missed += missing if missing > 0 else 0
        self._steps.append(step)
