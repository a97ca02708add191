"""The process of `sgor_node`: how it starts, and how it ends.

Exit codes: 0 after SIGINT or SIGTERM, at any moment; 2 where it cannot start as it was told to;
1 with a traceback where the program is wrong.
"""
import os
import sys
from typing import TYPE_CHECKING

from . import signals

if TYPE_CHECKING:
    from .sgor_node import SgorNode

# how long the executor waits before it looks for a signal
PATIENCE_S = 0.1


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal comes; return the exit code of the process."""
    signals.end_at_once()
    # late: this takes a second, in which signals must do already
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from ..core.common.settings import InputError
    from .sgor_node import SgorNode

    flag = signals.SignalFlag()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        # such as a parameter file that is missing or is no YAML
        return _refuse(error)
    try:
        return _run(SgorNode(), flag)
    except InputError as error:
        return _refuse(error)
    finally:
        signals.ignore()
        rclpy.try_shutdown()


def _run(node: 'SgorNode', flag: signals.SignalFlag) -> int:
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    node.start()
    try:
        while not flag.raised and not node.crash:
            executor.spin_once(PATIENCE_S)
    finally:
        ended = node.stop()
        print(node.counts(), flush=True)
        if not ended:
            # it compiles, or its scan takes minutes: threads can't be stopped, processes can
            sys.stderr.flush()
            os._exit(0)
        executor.shutdown()
        node.destroy_node()
    if node.crash:
        raise node.crash
    return 0


def _refuse(error: Exception) -> int:
    print(f'error: {error}', file=sys.stderr)
    return 2


if __name__ == '__main__':
    sys.exit(main())
