"""`sgor_node`: labelled clouds in, poses out. It converts, calls the tracker and publishes."""
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from ..core.common.settings import InputError
from ..core.warmup import warm_up
from ..io import messages
from ..io.frames import frame_id
from ..io.label_field import choice_in_words
from ..io.label_field import label_field_of
from ..io.pointcloud2 import decode
from ..tracker import Tracker
from . import status
from .clouds import Clouds
from .log import SparingLog
from .outputs import Outputs
from .parameters import NodeParameters
from .slot import NewestSlot

# before this, loading is nothing to talk about
COMPILING_S = 1.0
# a scan at work is finished before the end, unless it takes this long
GRACE_S = 3.0


class SgorNode(Node):
    """One thread receives (the executor's), one works; between them a slot for the newest scan."""

    def __init__(self) -> None:
        super().__init__('sgor_node')
        self._settings = NodeParameters(self)
        self._config = self._settings.node_config
        self._tracker = Tracker(*self._settings.live)
        self._outputs = Outputs(self, self._config)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_service(Trigger, 'reset', self._on_reset)
        self._reset_wanted = threading.Event()
        self._slot: NewestSlot[tuple[PointCloud2, float]] = NewestSlot()
        self._processed = 0
        self._failed = 0
        self._log = SparingLog(self.get_logger())
        self._worker = threading.Thread(target=self._work, name='sgor worker')
        self._compiled = False
        self.crash: Exception | None = None

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
                             self._failed)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reset_wanted.set()
        response.success = True
        response.message = 'the next scan starts a new track'
        return response

    def _work(self) -> None:
        """Run on the worker's thread until the slot is closed."""
        try:
            self._warm_up()
            self._compiled = True
            self._clouds = Clouds(self, self._config.reliability,
                                  lambda cloud: self._slot.put((cloud, time.monotonic())))
            while (item := self._slot.take()) is not None:
                self._process(*item)
        except Exception as error:
            self.crash = error

    def _warm_up(self) -> None:
        log = self.get_logger()
        said = threading.Timer(COMPILING_S, log.info, [
            'compiling; once, the result is kept for the next start'])
        begin = time.monotonic()
        said.start()
        try:
            warm_up(self._settings.live[0])
        finally:
            said.cancel()
            said.join()
        log.info(f'ready after {time.monotonic() - begin:.1f} s, waiting for clouds on '
                 f'{self.resolve_topic_name("points")}')

    def _process(self, cloud: PointCloud2, received: float) -> None:
        begin = time.monotonic()
        stamp_ns = messages.stamp_ns_of(cloud.header)
        frame = self._config.sensor_frame or frame_id(cloud.header.frame_id)
        if not frame:
            self._log.once('the clouds have no frame_id: set the parameter sensor_frame')
        self._tracker.config, self._tracker.tracker_config = self._settings.live
        if self._reset_wanted.is_set():
            self._reset_wanted.clear()
            self._tracker.reset()
        self._log.note(choice_in_words(cloud, self._config.label_field))
        try:
            scan = decode(cloud, label_field_of(cloud, self._config.label_field))
            tracked = self._tracker.track(scan, stamp_ns)
        except InputError as error:
            self._failed += 1
            level, message, values = status.ERROR, f'unusable cloud: {error}', {}
        else:
            self._processed += tracked.success
            self._failed += not tracked.success
            unplaced = self._outputs.publish(tracked, frame)
            level, message = status.judged(tracked, unplaced)
            values = status.details(tracked)
        self._log.trouble('' if level == status.OK else message,
                          f'scan at {stamp_ns * 1e-9:.3f} s')
        now = time.monotonic()
        values |= {'seconds': f'{now - begin:.4f}', 'latency': f'{now - received:.4f}'}
        self._diagnostics.publish(status.diagnostics(
            self.get_fully_qualified_name(), frame, stamp_ns, level, message, self.counts(),
            values))
