"""`SgorNode`: clouds of a topic to the pipeline on a thread of its own, and its health told."""
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
import threading
import time
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from ..core.common.settings import InputError
from ..core.warmup import warm_up
from ..io.header_stamp import stamp_ns_of
from ..io.sequence import ScanSequence
from ..io.sequence import StampedScan
from ..mapping import Map
from ..mapping import Mapper
from ..pipeline import extrinsic
from ..pipeline.loop_process import end
from ..pipeline.loop_process import loop_process
from ..pipeline.pipeline import Pipeline
from ..tracker import State
from ..tracker import Tracker
from .diagnostics import status
from .diagnostics.publisher import DiagnosticsPublisher
from .diagnostics.throttled_log import forwarded
from .diagnostics.throttled_log import ThrottledLog
from .input.stamp_gaps import StampGaps
from .input.stream import CloudStream
from .input.subscription import CloudSubscription
from .input.subscription import override_names
from .map_services import MapServices
from .output.publishers import refuse_unknown_overrides
from .output.sink import TopicSink
from .output.tf2_extrinsic import tf2_extrinsic
from .parameters import NodeConfig
from .parameters import NodeParameters
from .services import Services

# a scan at work is finished before the end, unless it takes this long
GRACE_S = 3.0


class SgorNode(Node):
    """One thread receives (the executor's), one works; between them a slot for the latest scan.

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
        self._loops: ProcessPoolExecutor | None = None
        self._pipeline = self._pipeline_of(self._config)
        self._at_work = threading.Lock()    # held while a scan changes the map
        self._requests = Services(self, self._config.odom_frame)
        self._map = MapServices(self, self._pipeline, self._at_work,
                                lambda: self._settings.map_folder, self._config.map_frame)
        self._stream = CloudStream(self.resolve_topic_name('points'), self._config.label_field,
                                   self._config.time_field)
        self._gaps = StampGaps()
        self._processed = self._failed = self._late = self._paused = 0
        self._log = ThrottledLog(self.get_logger())
        self._diagnostics = DiagnosticsPublisher(self, self._log, self.counts, self._idle)
        self._worker = threading.Thread(target=self._work, name='sgor worker')
        self._compiled = self._placed = False
        self._heard_at = self._began_at = 0.0
        self.crash: Exception | None = None
        refuse_unknown_overrides(self, override_names(self))

    def _pipeline_of(self, config: NodeConfig) -> Pipeline:
        self._sink = TopicSink(self, config.publish_tf, config.loop_closure)
        mount = extrinsic.configured(config)
        if mount is None and config.base_frame:
            mount = tf2_extrinsic(self, config.base_frame)
        return Pipeline(self._tracker(config), config, self._sink, mount,
                        inverted_tf=config.invert_tf)

    def _tracker(self, config: NodeConfig) -> Tracker | Mapper:
        if not config.loop_closure:
            if config.map_folder:
                raise InputError('map_folder: needs loop_closure: true')
            return Tracker(*self._settings.live)
        self._loops = loop_process()
        known = None
        if config.map_folder and Path(config.map_folder).exists():
            known = Map.load(config.map_folder)
            self.get_logger().info(f'{config.map_folder}: {known}, to be found in')
        mapper = Mapper(*self._settings.live, self._settings.mapper_config, executor=self._loops,
                        map=known)
        if config.localization:
            mapper.freeze()
        return mapper

    def start(self) -> None:
        """Begin to work; clouds are subscribed to once everything is compiled."""
        self._worker.start()

    def stop(self) -> bool:
        """Let the worker finish its scan, wait a while; return whether it has ended.

        One that compiles is not waited for: that may take minutes.
        """
        self._stream.close()
        self._map.close()
        if self._worker.is_alive():
            self._worker.join(GRACE_S if self._compiled else 0.0)
        if self._loops is not None:
            end(self._loops)
        return not self._worker.is_alive()

    def counts(self) -> status.Counts:
        """Return what became of the scans so far."""
        return status.Counts(self._stream.received, self._processed, self._stream.replaced,
                             self._failed, self._late, self._gaps.missed, self._paused)

    def _idle(self) -> tuple[bytes, str]:
        """Return level and words for what is going on while there is no scan to report."""
        now = time.monotonic()
        if not self._compiled:
            return status.WARN, 'compiling'
        if self._requests.paused:
            return status.WARN, 'paused: clouds are left out'
        if self._began_at:
            return status.WARN, f'a scan has been worked on for {now - self._began_at:.1f} s'
        if not self._heard_at:
            return status.WARN, 'no clouds yet'
        return status.STALE, f'no clouds for {now - self._heard_at:.1f} s'

    def _receive(self, cloud: PointCloud2) -> None:
        self._heard_at = time.monotonic()
        self._gaps.take(stamp_ns_of(cloud.header))
        if self._requests.paused:
            self._paused += 1
        else:
            self._stream.put(cloud)

    def _work(self) -> None:
        """Run on the worker's thread until the stream is closed."""
        try:
            self._warm_up()
            self._compiled = True
            self._subscription = CloudSubscription(self, self._config.reliability, self._receive)
            self._process_all(self._stream)
        except Exception as error:
            self.crash = error

    def _warm_up(self) -> None:
        log = self.get_logger()
        begin = time.monotonic()
        with forwarded(log):
            warm_up(self._settings.live[0])
        if self._loops is not None:
            self._loops.submit(int)    # anything: it starts
        log.info(f'ready after {time.monotonic() - begin:.1f} s, waiting for clouds on '
                 f'{self._stream.name}')

    def _process_all(self, scans: ScanSequence) -> None:
        for scan in scans:
            self._began_at = time.monotonic()
            self._process(scan)
            self._began_at = 0.0

    def _process(self, scan: StampedScan) -> None:
        """Apply what was asked for, run the pipeline, count and report what became of the scan."""
        self._log.info_once(scan.note)
        self._apply_requests()
        with self._at_work:
            outcome = self._pipeline.process(scan)
        self._map.heard(outcome)
        if not outcome.frame:
            self._log.warn_once('the clouds have no frame_id: set the parameter sensor_frame')
        if outcome.T_odom_child is not None and not self._placed:
            self._placed = True
            self.get_logger().info(
                f'first pose, of {self._config.base_frame or outcome.frame} in '
                f'{self._config.odom_frame}, at {outcome.stamp_ns * 1e-9:.3f} s; from now on the '
                'log tells of trouble only, /diagnostics of each scan')
        if self._sink.unacknowledged_edges:
            self._log.warn_once('a subscriber of the edges does not keep up: it may miss some; '
                                '/diagnostics counts them (edges unacknowledged)')
        tracked = outcome.tracked
        late = tracked is not None and tracked.state is State.LATE
        done = tracked is not None and tracked.success
        self._processed += done
        self._late += late
        self._failed += not done and not late
        now = time.monotonic()
        self._diagnostics.report(outcome.stamp_ns, outcome.frame, *status.level_of(outcome), {
            **status.details(tracked), **status.map_details(self._pipeline.mapper),
            'edges unacknowledged': str(self._sink.unacknowledged_edges),
            'seconds': f'{now - self._began_at:.4f}',
            'latency': f'{now - scan.arrived_ns * 1e-9:.4f}'})

    def _apply_requests(self) -> None:
        """Take over the parameters and what the services were asked for since the last scan."""
        tracker = self._pipeline.tracker
        tracker.config, tracker.tracker_config = self._settings.live
        reset, start = self._requests.take()
        if start is not None:
            self._pipeline.begin_at(*start)
        if (hint := self._map.take_hint()) is not None:
            self._pipeline.hint(hint)
        if reset:
            tracker.reset()
