"""SIGINT and SIGTERM, from the first moment of the process to the last.

rclpy's handlers take the context down from a thread of their own, whatever uses it at that
moment. Here a signal changes nothing by itself: while modules load it ends the process at once,
for there is nothing to be undone yet; afterwards it is noted until the main loop asks for it.
"""
from collections.abc import Callable
import os
import signal
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM)


def end_at_once() -> None:
    """Let the signals end this process with code 0 from now on, without a word."""
    _handle(lambda *_: os._exit(0))


def ignore() -> None:
    """Let nothing disturb the end: Python would bring the deadly defaults back."""
    _handle(signal.SIG_IGN)


class SignalFlag:
    """Notes that a signal came, from now on; they do nothing else."""

    def __init__(self) -> None:
        self.raised = False
        _handle(self._raise)

    def _raise(self, _: int, __: FrameType | None) -> None:
        self.raised = True


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for number in ENDING:
        signal.signal(number, handler)
