"""Hand-over from the thread that receives to the thread that works: the latest value wins."""
from collections.abc import Iterator
import threading


class LatestValueSlot[Item]:
    """Room for one item. A newer one takes its place, and what was replaced is counted.

    Iterating takes one item after the other, waits for each, and ends when the slot is closed.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._item: Item | None = None
        self._closed = False
        self.received = 0
        self.replaced = 0

    def put(self, item: Item) -> None:
        """Store an item in place of one that nobody took."""
        with self._changed:
            self.received += 1
            self.replaced += self._item is not None
            self._item = item
            self._changed.notify()

    def take(self) -> Item | None:
        """Wait for an item and take it; None once the slot is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._item is not None)
            item, self._item = self._item, None
            return None if self._closed else item

    def __iter__(self) -> Iterator[Item]:
        while (item := self.take()) is not None:
            yield item

    def close(self) -> None:
        """Let nobody wait any longer."""
        with self._changed:
            self._closed = True
            self._changed.notify()
