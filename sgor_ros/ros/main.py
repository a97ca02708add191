"""The process of `sgor_node`: how it starts, and how it ends.

Exit codes: 0 after SIGINT or SIGTERM, at any moment; 2 where it cannot start as it was told to;
1 with a traceback where the program is wrong.
"""
from importlib import metadata
import os
import sys
from typing import TYPE_CHECKING

from ..core.execution.cache import choose_cache_folder
from ..io import standard_streams
from . import signals

if TYPE_CHECKING:
    from .node import SgorNode

# how long the executor waits before it looks for a signal
PATIENCE_S = 0.1
HELP = """\
usage: sgor_node [--ros-args [-r points:=TOPIC] [-p NAME:=VALUE ...] [--params-file YAML]]

Odometry and relative poses from labelled clouds (sensor_msgs/PointCloud2 on `points`), as a ROS 2
node. Parameters, with unit, bounds and meaning: config/sgor_node.yaml, which is a parameter file.

examples:
  ros2 run sgor_ros sgor_node --ros-args -r points:=/lidar/labelled
  ros2 run sgor_ros sgor_node --ros-args -p mode:=consecutive -p voxel_size:=0.3
  ros2 param describe /sgor_node voxel_size
  .venv/bin/sgor_node --ros-args -r points:=/lidar/labelled    (ROS from wheels: no `ros2 run`)

exit codes:
  0    ended by SIGINT or SIGTERM
  1    a fault of the program (with a traceback)
  2    cannot start as it was told to"""


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal comes; return the exit code of the process."""
    signals.end_at_once()
    standard_streams.fill_gaps()
    if asked := _asked(sys.argv[1:] if args is None else args):
        with standard_streams.not_needed():
            print(asked)
        return 0
    choose_cache_folder()
    # late: this takes a second, in which signals must do already
    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ImportError as error:
        return _refuse(f'no ROS 2 here ({error}): source /opt/ros/jazzy/setup.bash')

    from ..core.common.settings import InputError
    from .node import SgorNode

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
        with standard_streams.not_needed():
            print(node.counts())
        if not ended:
            # it compiles, or its scan takes minutes: threads can't be stopped, processes can
            sys.stderr.flush()
            os._exit(0)
        executor.shutdown()
        node.destroy_node()
    if node.crash:
        raise node.crash
    return 0


def _asked(args: list[str]) -> str:
    """Return what was asked for in place of a node: needs no ROS."""
    own = args[:args.index('--ros-args')] if '--ros-args' in args else args
    if '--version' in own:
        return f'sgor_ros {metadata.version("sgor_ros")}'
    return HELP if {'-h', '--help'} & set(own) else ''


def _refuse(error: Exception | str) -> int:
    with standard_streams.not_needed():
        print(f'error: {error}', file=sys.stderr)
    return 2


if __name__ == '__main__':
    sys.exit(main())
