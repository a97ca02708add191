"""`SgorNode`: labelled clouds in, poses out. It converts, calls the tracker and publishes."""
from dataclasses import replace
import threading
import time
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from ..core.common.settings import InputError
from ..core.warmup import warm_up
from ..io import messages
from ..io.frames import frame_id
from ..io.label_field import choice_in_words
from ..io.label_field import label_field_of
from ..io.pointcloud2 import decode
from ..tracker import State
from ..tracker import TrackedScan
from ..tracker import Tracker
from . import status
from .clouds import Clouds
from .clouds import override_names
from .commands import Commands
from .gaps import Gaps
from .health import Health
from .log import forwarded
from .log import SparingLog
from .outputs import Outputs
from .parameters import NodeParameters
from .publishers import refuse_unknown_overrides
from .slot import NewestSlot

# a scan at work is finished before the end, unless it takes this long
GRACE_S = 3.0


class SgorNode(Node):
    """One thread receives (the executor's), one works; between them a slot for the newest scan.

    Parameters
    ----------
    name : str
    options
        Of `rclpy.node.Node`, such as ``namespace`` and ``parameter_overrides``, for several nodes
        in one process.
    """

    def __init__(self, name: str = 'sgor_node', **options: Any) -> None:
        super().__init__(name, **options)
        self._settings = NodeParameters(self)
        self._config = self._settings.node_config
        self._tracker = Tracker(*self._settings.live)
        self._outputs = Outputs(self, self._config)
        self._commands = Commands(self, self._config.odom_frame)
        self._slot: NewestSlot[tuple[PointCloud2, float]] = NewestSlot()
        self._gaps = Gaps()
        self._processed = self._failed = self._late = self._paused = 0
        self._frame = ''
        self._log = SparingLog(self.get_logger())
        self._health = Health(self, self._log, self.counts, self._idle)
        self._worker = threading.Thread(target=self._work, name='sgor worker')
        self._compiled = False
        self._heard_at = self._began_at = 0.0
        self.crash: Exception | None = None
        refuse_unknown_overrides(self, override_names(self))

    def start(self) -> None:
        """Begin to work; clouds are subscribed to once everything is compiled."""
        self._worker.start()

    def stop(self) -> bool:
        """Let the worker finish its scan, wait a while; return whether it has ended.

        One that compiles is not waited for: that may take minutes.
        """
        self._slot.close()
        if self._worker.is_alive():
            self._worker.join(GRACE_S if self._compiled else 0.0)
        return not self._worker.is_alive()

    def counts(self) -> status.Counts:
        """Return what became of the scans so far."""
        return status.Counts(self._slot.received, self._processed, self._slot.replaced,
                             self._failed, self._late, self._gaps.missed, self._paused)

    def _idle(self) -> tuple[bytes, str]:
        """Return level and words for what is going on while no scan is told of."""
        now = time.monotonic()
        if not self._compiled:
            return status.WARN, 'compiling'
        if self._commands.paused:
            return status.WARN, 'paused: clouds are left out'
        if self._began_at:
            return status.WARN, f'a scan has been worked on for {now - self._began_at:.1f} s'
        if not self._heard_at:
            return status.WARN, 'no clouds yet'
        return status.STALE, f'no clouds for {now - self._heard_at:.1f} s'

    def _receive(self, cloud: PointCloud2) -> None:
        self._heard_at = time.monotonic()
        self._gaps.take(messages.stamp_ns_of(cloud.header))
        if self._commands.paused:
            self._paused += 1
        else:
            self._slot.put((cloud, self._heard_at))

    def _work(self) -> None:
        """Run on the worker's thread until the slot is closed."""
        try:
            self._warm_up()
            self._compiled = True
            self._clouds = Clouds(self, self._config.reliability, self._receive)
            while (item := self._slot.take()) is not None:
                self._began_at = time.monotonic()
                self._process(*item)
                self._began_at = 0.0
        except Exception as error:
            self.crash = error

    def _warm_up(self) -> None:
        log = self.get_logger()
        begin = time.monotonic()
        with forwarded(log):
            warm_up(self._settings.live[0])
        log.info(f'ready after {time.monotonic() - begin:.1f} s, waiting for clouds on '
                 f'{self.resolve_topic_name("points")}')

    def _process(self, cloud: PointCloud2, received: float) -> None:
        stamp_ns = messages.stamp_ns_of(cloud.header)
        frame = self._config.sensor_frame or frame_id(cloud.header.frame_id)
        if not frame:
            self._log.once('the clouds have no frame_id: set the parameter sensor_frame')
        try:
            tracked = self._track(cloud, stamp_ns, frame)
        except InputError as error:
            self._failed += 1
            level, message, values = status.ERROR, f'unusable cloud: {error}', {}
        else:
            late = tracked.state is State.LATE
            self._processed += tracked.success
            self._late += late
            self._failed += not tracked.success and not late
            unplaced = self._outputs.publish(tracked, frame)
            level, message = status.judged(tracked, unplaced)
            values = status.details(tracked)
        now = time.monotonic()
        values |= {'seconds': f'{now - self._began_at:.4f}', 'latency': f'{now - received:.4f}'}
        self._health.tell(stamp_ns, frame, level, message, values)

    def _track(self, cloud: PointCloud2, stamp_ns: int, frame: str) -> TrackedScan:
        """Do what was commanded, then hand the scan to the tracker."""
        self._tracker.config, self._tracker.tracker_config = self._settings.live
        reset, start = self._commands.take()
        if start is not None:
            self._outputs.odom_frame.begin_at(*start)
        if reset:
            self._tracker.reset()
        label_field = self._config.label_field
        self._log.note(choice_in_words(cloud, label_field))
        tracked = self._tracker.track(decode(cloud, label_field_of(cloud, label_field)), stamp_ns)
        before, self._frame = self._frame, frame
        if before in ('', frame) or tracked.restarted:
            return tracked
        # the pose is right all the same, the motion is not that of one sensor
        return replace(tracked, twist=None, twist_covariance=None, warnings=(
            *tracked.warnings, f'the frame of the clouds changed from {before} to {frame}'))
