"""The frame around every command: its help, its exit code and what it says when it ends badly."""
from argparse import ArgumentDefaultsHelpFormatter
from argparse import ArgumentParser
from argparse import Namespace
from argparse import RawDescriptionHelpFormatter
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
import os
import signal
import sys
from textwrap import fill
import threading
import traceback
from types import FrameType
from typing import NoReturn

from ..core.common.settings import InputError

OK = 0
FAILED = 1
REFUSED = 2
BROKE_OFF = 3
INTERRUPTED = 128 + signal.SIGINT
UNHEARD = 128 + signal.SIGPIPE
TERMINATED = 128 + signal.SIGTERM

CODES = {
    REFUSED: 'cannot be done as told: an option, a file, or a package that is missing',
    BROKE_OFF: 'broke off: disk full, out of memory, or a fault of the program (with a traceback)',
    INTERRUPTED: f'ended by SIGINT (Ctrl-C); {TERMINATED} by SIGTERM'}
HELP_WIDTH = 98


class Terminated(BaseException):
    """SIGTERM came."""


class _Formatter(ArgumentDefaultsHelpFormatter, RawDescriptionHelpFormatter):
    """Tells defaults that say something, and keeps the lines of examples."""

    def _get_help_string(self, action: object) -> str | None:
        if getattr(action, 'default', None) in (None, False):
            return getattr(action, 'help', None)
        return super()._get_help_string(action)    # type: ignore[arg-type]


class Parser(ArgumentParser):
    """A parser that answers a slip in two lines, not with the usage of a hundred options.

    Parameters
    ----------
    prog : str
        Name of the command; ``python -m`` would tell another.
    usage : str
        What follows the name: the arguments that it needs.
    description : str
    examples : sequence of str
        Command lines.
    done, failed : str
        What the exit codes 0 and 1 mean; empty where 1 never comes.
    """

    def __init__(self, prog: str, usage: str = '', description: str = '',
                 examples: tuple[str, ...] = (), done: str = 'done', failed: str = '',
                 **others: object) -> None:
        codes = {OK: done, **({FAILED: failed} if failed else {}), **CODES}
        epilog = '\n'.join((
            'examples:', *(f'  {line}' for line in examples),
            '', 'exit codes:', *(f'  {code:<4} {meaning}' for code, meaning in codes.items())))
        super().__init__(prog=prog, usage=f'{prog} {usage}', epilog=epilog,
                         description=fill(description, HELP_WIDTH), formatter_class=_Formatter)
        self.add_argument('--version', action='version', version=f'sgor_ros {version()}')

    def error(self, message: str) -> NoReturn:
        """Tell what is wrong and how it goes, and end."""
        self.exit(REFUSED, f'error: {message}\nusage: {self.usage}; {self.prog} --help tells '
                  'more\n')


def version() -> str:
    """Return the version of the installed package."""
    try:
        return metadata.version('sgor_ros')
    except metadata.PackageNotFoundError:
        return 'not installed'


def run(command: Callable[[Namespace], int], arguments: Namespace) -> int:
    """Run a command and return its exit code; what it refuses is told in one line."""
    try:
        with _terminable():
            code = command(arguments)
            sys.stdout.flush()
            return code
    except InputError as error:
        return _end(REFUSED, str(error))
    except BrokenPipeError:
        # whoever read has had enough, as `head` does: nobody is left to tell
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNHEARD
    except OSError as error:
        return _end(BROKE_OFF, str(error))
    except MemoryError as error:
        return _end(BROKE_OFF, f'out of memory; {error}')
    except KeyboardInterrupt:
        return _end(INTERRUPTED, 'interrupted')
    except Terminated:
        return _end(TERMINATED, 'terminated')
    except Exception:
        traceback.print_exc()
        return _end(BROKE_OFF, 'a fault of the program: please report it with the lines above')


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end the command as Ctrl-C does, so that nothing half written stays behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _terminate(_: int, __: FrameType | None) -> None:
    # the next one ends what clears away
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    raise Terminated


def _end(code: int, message: str) -> int:
    print(f'error: {message}', file=sys.stderr)
    return code
