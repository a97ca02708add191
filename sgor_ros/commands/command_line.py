"""What every command has in common: its help, exit codes, and one line for what went wrong."""
from argparse import Action
from argparse import ArgumentDefaultsHelpFormatter
from argparse import ArgumentParser
from argparse import Namespace
from argparse import RawDescriptionHelpFormatter
from argparse import SUPPRESS
from collections.abc import Callable
from importlib import metadata
import signal
import sys
from textwrap import fill
import threading
import traceback
from types import FrameType
from typing import Any
from typing import NoReturn

from ..core.common.settings import InputError
from ..io import standard_streams

OK = 0
FAILED = 1
REFUSED = 2
BROKE_OFF = 3
# as shells tell of what a signal has ended
INTERRUPTED = 128 + signal.SIGINT
UNHEARD = 128 + signal.SIGPIPE

CODES = {
    REFUSED: 'cannot be done as told: an option, a file, or a package that is missing',
    BROKE_OFF: 'broke off: disk full, out of memory, or a fault of the program (with a traceback)',
    INTERRUPTED: 'ended by SIGINT (Ctrl-C); 143 by SIGTERM'}
HELP_WIDTH = 98
AGAIN_S = 0.1


class _Formatter(ArgumentDefaultsHelpFormatter, RawDescriptionHelpFormatter):
    """Tells defaults that say something, and keeps the lines of examples."""

    def _get_help_string(self, action: object) -> str | None:
        default = getattr(action, 'default', None)
        if default is None or default is False:
            return getattr(action, 'help', None)
        return super()._get_help_string(action)    # type: ignore[arg-type]


class _HelpAll(Action):
    """Print the options that ``--help`` leaves out too."""

    def __init__(self, option_strings: list[str], dest: str) -> None:
        super().__init__(option_strings, SUPPRESS, nargs=0, help='the other options too')

    def __call__(self, parser: ArgumentParser, *_: object) -> None:
        assert isinstance(parser, Parser)
        with standard_streams.not_needed():
            sys.stdout.write(parser.format_all_help())
        parser.exit()


class Parser(ArgumentParser):
    """A parser that answers a slip in two lines, not with the usage of a hundred options.

    ``--help`` tells the options that many need; ``--help-all`` those of `leave_out` too.

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
        standard_streams.fill_gaps()
        codes = {OK: done, **({FAILED: failed} if failed else {}), **CODES}
        epilog = '\n'.join((
            'examples:', *(f'  {line}' for line in examples),
            '', 'exit codes:', *(f'  {code:<4} {meaning}' for code, meaning in codes.items())))
        super().__init__(prog=prog, usage=f'{prog} {usage}', epilog=epilog,
                         description=fill(description, HELP_WIDTH), formatter_class=_Formatter)
        self._left_out: dict[Action, str | None] = {}
        self.add_argument('-V', '--version', action='version', version=f'sgor_ros {version()}')

    def leave_out(self, option: Action) -> None:
        """Let ``--help`` leave out an option, and ``--help-all`` tell it."""
        if not self._left_out:
            self.add_argument('--help-all', action=_HelpAll)
        self._left_out[option] = option.help

    def format_help(self) -> str:
        """Return the help without what is left out."""
        for option in self._left_out:
            option.help = SUPPRESS
        try:
            return super().format_help()
        finally:
            for option, told in self._left_out.items():
                option.help = told

    def format_all_help(self) -> str:
        """Return the help with all options."""
        return super().format_help()

    def exit(self, status: int = OK, message: str | None = None) -> NoReturn:
        """End, with a message on stderr; help that nobody reads to its end is no error."""
        with standard_streams.not_needed():
            if message:
                sys.stderr.write(message)
        sys.exit(status)

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
    """Run a command and return its exit code; what it refuses is told in one line.

    SIGTERM ends it as Ctrl-C does, so that nothing half written stays behind.
    """
    signals = _Signals()
    try:
        with signals:
            code = command(arguments)
            sys.stdout.flush()
            return code
    except _Ended:
        return _by_signal(signals.came)
    except Exception as error:
        # in the midst of C code an exception may turn into another
        return _by_signal(signals.came) if signals.came else _judged(error)


class _Ended(BaseException):
    """A signal came."""


class _Signals:
    """Turns SIGINT and SIGTERM into `_Ended`, in whatever the main thread does just then.

    Where that is a callback from C code, such as one of the compiler, the exception is lost: it
    is raised again until it is on its way.
    """

    def __init__(self) -> None:
        self.came = 0
        self._before: dict[int, Any] = {}
        self._told = sys.unraisablehook

    def __enter__(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        sys.unraisablehook = self._tell
        self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._again)
        for number in (signal.SIGINT, signal.SIGTERM):
            # ignored in the background of a script, say
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._end)

    def __exit__(self, *_: object) -> None:
        if not self._before:
            return
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in self._before.items():
            signal.signal(number, handler)
        sys.unraisablehook = self._told

    def _end(self, number: int, _: FrameType | None) -> None:
        self.came = number
        # the next one ends what clears away
        signal.signal(number, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S, AGAIN_S)
        raise _Ended

    def _again(self, _: int, __: FrameType | None) -> None:
        """Raise once more, unless what is at work is the clearing away after the first."""
        error = sys.exception()
        while error is not None:
            if isinstance(error, _Ended):
                return
            error = error.__context__
        raise _Ended

    def _tell(self, lost: Any) -> None:
        if lost.exc_type is not _Ended:
            self._told(lost)


def _by_signal(number: int) -> int:
    return _end(128 + number, f'ended by {signal.Signals(number).name}')


def _judged(error: Exception) -> int:
    """Tell what went wrong and return the exit code for it."""
    if isinstance(error, InputError):
        return _end(REFUSED, str(error))
    if isinstance(error, BrokenPipeError):
        # whoever read has had enough, as `head` does: nobody is left to tell
        standard_streams.forget()
        return UNHEARD
    if isinstance(error, OSError):
        return _end(BROKE_OFF, str(error))
    if isinstance(error, MemoryError):
        return _end(BROKE_OFF, f'out of memory; {error}')
    traceback.print_exception(error)
    return _end(BROKE_OFF, 'a fault of the program: please report it with the lines above')


def _end(code: int, message: str) -> int:
    with standard_streams.not_needed():
        print(f'error: {message}', file=sys.stderr)
    return code
