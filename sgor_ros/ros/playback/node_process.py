"""`sgor_node` as a process of its own."""
import os
from pathlib import Path
import signal
import subprocess
import sys
from types import TracebackType
from typing import Self

from .domain import Domain

STOP_TIMEOUT_S = 30.0


class NodeProcess:
    """`sgor_node` as a process of its own; use it in a ``with``.

    Parameters
    ----------
    domain : Domain
    log : Path
        File for what it prints.
    arguments : sequence of str
        ROS arguments, such as ``-p``, ``mode:=consecutive``.
    """

    def __init__(self, domain: Domain, log: Path, *arguments: str) -> None:
        self.log = log
        with log.open('w') as file:
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'sgor_ros.ros.main', '--ros-args', *arguments],
                stdout=file, stderr=subprocess.STDOUT, env=domain.environment())

    def __enter__(self) -> Self:
        """Do nothing: it runs already."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """End it whatever happened."""
        if self.alive():
            self.process.kill()
        self.process.wait()

    def alive(self) -> bool:
        """Return whether it still runs."""
        return self.process.poll() is None

    def stop(self) -> int:
        """Interrupt it as Ctrl-C does and return its exit code."""
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def memory_mb(self) -> float:
        """Return the memory that it holds now; NaN where the system does not tell."""
        try:
            pages = int(Path(f'/proc/{self.process.pid}/statm').read_text().split()[1])
        except (OSError, ValueError, IndexError):
            return float('nan')
        return pages * os.sysconf('SC_PAGE_SIZE') / 1e6
