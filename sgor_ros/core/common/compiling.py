"""Says when numba compiles: the first call on a machine takes a minute, and silence looks dead.

Numba tells of a function once it has not found it in the cache, before it compiles it. The text
goes to the logger `sgor_ros` as a warning: Python shows warnings where nobody has set up logging.
"""
import logging
from typing import Any

from numba.core import event

_register: Any = event.register    # untyped
_log = logging.getLogger('sgor_ros')


class _Teller(event.Listener):
    """Warns at the first function of this package."""

    _told = False

    def on_start(self, started: Any) -> None:
        """Warn, once in the life of a process."""
        if not self._told and started.data['dispatcher'].__module__.startswith('sgor_ros.'):
            self._told = True
            _log.warning('compiling for this machine, which takes a minute or two; once, the '
                         'result is kept for the next start')

    def on_end(self, ended: Any) -> None:
        """Say nothing: the next function begins at once."""


def tell_of_compiling() -> None:
    """Begin to listen; once a process is enough."""
    _register('numba:compile', _Teller())
