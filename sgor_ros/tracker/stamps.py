"""Which scans are late, and when time itself has jumped."""
from enum import Enum

from .config import TrackerConfig


class Arrival(Enum):
    """How a stamp fits those before."""

    ON_TIME = 0
    LATE = 1
    ANEW = 2


class Stamps:
    """Watches stamps: one that is wrong must not end a track, and a bag that starts over must."""

    def __init__(self) -> None:
        self.newest_ns: int | None = None
        self._before_ns: int | None = None
        self._late_ns: int | None = None
        self._first_late_ns = 0
        self._late_in_a_row = 0

    def judge(self, stamp_ns: int, config: TrackerConfig) -> Arrival:
        """Judge the next stamp; those that are on time or begin anew are remembered."""
        newest = self.newest_ns
        if newest is None or stamp_ns > newest:
            self._take(stamp_ns, newest)
            return Arrival.ON_TIME
        if stamp_ns in (newest, 0):    # 0: nobody has set it
            return Arrival.LATE
        if self._late_ns is None or stamp_ns <= self._late_ns:
            self._late_in_a_row, self._first_late_ns = 0, stamp_ns
        self._late_in_a_row += 1
        self._late_ns = stamp_ns
        jumped = self._late_in_a_row >= 2 and newest - stamp_ns > config.jump_back * 1e9
        if not jumped and self._late_in_a_row < config.max_late:
            return Arrival.LATE
        # late ones that go on from the scan before the newest: that one's stamp was wrong
        if self._before_ns is not None and self._before_ns < self._first_late_ns:
            self._take(stamp_ns, self._before_ns)
            return Arrival.ON_TIME
        self._take(stamp_ns, None)
        return Arrival.ANEW

    def _take(self, stamp_ns: int, before_ns: int | None) -> None:
        self.newest_ns, self._before_ns = stamp_ns, before_ns
        self._late_ns, self._late_in_a_row = None, 0
