"""What others may ask of the map: services to save, load, locate and set the mode; `initialpose`.

They are of std_srvs, as those of RTAB-Map and slam_toolbox are where they can be: nothing that is
to be had from wheels has room for an answer in words and a path. The parameter `map_folder` is the
path; `nav_msgs/srv/LoadMap` would take one, and answers with an occupancy grid and a number.
"""
from collections.abc import Callable
from collections.abc import Coroutine
from concurrent.futures import Future
from concurrent.futures import ThreadPoolExecutor
import json
import threading
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.task import Future as RosFuture
from scipy.spatial.transform import Rotation
from std_srvs.srv import Trigger

from ..core.common.settings import InputError
from ..mapping import Located
from ..mapping import Map
from ..mapping import Mapper
from ..pipeline.outcome import Outcome
from ..pipeline.pipeline import Pipeline
from ..pipeline.query import Query
from .services import start_of

Array = NDArray[np.float64]
Answer = tuple[bool, str]

NEXT_SCAN_S = 1.0
"""So long `locate` waits for the next scan before it takes the last."""


class MapServices:
    """Answers on a thread of its own, so that scans are received and worked on meanwhile.

    Parameters
    ----------
    node : Node
    pipeline : Pipeline
    at_work : threading.Lock
        Held while a scan changes the map.
    folder : callable
        Returns the folder of the map as it is set now.
    map_frame : str
    """

    def __init__(self, node: Node, pipeline: Pipeline, at_work: threading.Lock,
                 folder: Callable[[], str], map_frame: str) -> None:
        self._log = node.get_logger()
        self._pipeline, self._at_work = pipeline, at_work
        self._folder, self._map_frame = folder, map_frame
        self._thread = ThreadPoolExecutor(1, 'sgor map')
        self._news = threading.Condition()
        self._last: Outcome | None = None
        self._hint: Array | None = None
        for name, act in (('save_map', self._save), ('load_map', self._load),
                          ('locate', self._locate),
                          ('set_mode_localization', self._localization),
                          ('set_mode_mapping', self._mapping)):
            node.create_service(Trigger, name, self._service(act))
        if pipeline.mapper is not None:
            node.create_subscription(PoseWithCovarianceStamped, 'initialpose',
                                     self._on_initial_pose, 1)

    def heard(self, outcome: Outcome) -> None:
        """Take the latest scan, which `locate` may ask for."""
        if outcome.scan is not None and self._pipeline.mapper is not None:
            with self._news:
                self._last = outcome
                self._news.notify_all()

    def take_hint(self) -> Array | None:
        """Return the pose (4, 4) of `initialpose`, where one came since the last call."""
        with self._news:
            hint, self._hint = self._hint, None
            return hint

    def close(self) -> None:
        """Take no more questions."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _service(self, act: Callable[[], Answer]
                 ) -> Callable[[Trigger.Request, Trigger.Response],
                               Coroutine[Any, Any, Trigger.Response]]:
        """Return what answers a service: the executor goes on until the answer is there."""
        async def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            answered = RosFuture()

            def tell(done: 'Future[Answer]') -> None:
                answered.set_result((False, 'the node ends') if done.cancelled()
                                    else done.result())

            self._thread.submit(self._guarded, act).add_done_callback(tell)
            response.success, response.message = await answered
            return response

        return answer

    def _guarded(self, act: Callable[[], Answer]) -> Answer:
        """Return the answer, whatever goes wrong: no question ends the node."""
        try:
            return act()
        except (InputError, OSError) as error:
            return False, str(error)
        except Exception as error:
            self._log.error(f'a question to the map: fault of the program: {error!r}')
            return False, f'fault of the program: {type(error).__name__}: {error}'

    def _mapper(self) -> Mapper:
        if self._pipeline.mapper is None:
            raise InputError('there is no map: the parameters loop_closure and map_folder are '
                             'needed')
        return self._pipeline.mapper

    def _named_folder(self) -> str:
        if not (folder := self._folder()):
            raise InputError('the parameter map_folder is needed; it can be set now')
        return folder

    def _save(self) -> Answer:
        mapper, folder = self._mapper(), self._named_folder()
        with self._at_work:
            known = mapper.map
        known.save(folder)
        return True, f'{folder}: {known}'

    def _load(self) -> Answer:
        """Go on in the map of the folder, lost at first; the mode stays."""
        mapper, folder = self._mapper(), self._named_folder()
        if mapper.graph.missing:
            raise InputError(mapper.graph.missing)
        known = Map.load(folder)
        with self._at_work:
            frozen = mapper.frozen
            self._pipeline.begin_in(known)
            if frozen:
                mapper.freeze()
        return True, '; '.join((f'{folder}: {known}, to be found in', *known.warnings))

    def _locate(self) -> Answer:
        mapper = self._mapper()
        with self._news:
            before = self._last
            self._news.wait_for(lambda: self._last is not before, NEXT_SCAN_S)
            outcome = self._last
        if outcome is None:
            raise InputError('no scan has come yet')
        with self._at_work:
            known, query = mapper.map, self._pipeline.query(outcome)
        found = query.locate(known)
        return found.success, json.dumps(as_dict(found, query, self._map_frame))

    def _localization(self) -> Answer:
        mapper = self._mapper()
        with self._at_work:
            mapper.freeze()
            known = mapper.map
        return True, f'{known} is followed, and nothing is added to it'

    def _mapping(self) -> Answer:
        mapper = self._mapper()
        with self._at_work:
            mapper.freeze(False)
        return True, 'what is new is added to the map'

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Look for the sensor there first, as long as it is lost."""
        start = start_of(message, self._map_frame)
        if isinstance(start, str):
            self._log.warning(f'initialpose: {start}: ignored')
            return
        with self._news:
            self._hint = start[0]
        self._log.info('initialpose: as long as the sensor is lost, it is looked for there first')


def as_dict(found: Located, query: Query, map_frame: str) -> dict[str, Any]:
    """Return where a scan was found, for JSON: poses are x y z qx qy qz qw, in metres."""
    def row(T: Array) -> list[float]:
        return [*T[:3, 3].tolist(), *Rotation.from_matrix(T[:3, :3]).as_quat().tolist()]

    stated = found.T_map_sensor is not None and (found.success or bool(found.alternatives))
    return {
        'stamp': f'{query.stamp_ns // 10**9}.{query.stamp_ns % 10**9:09d}', 'frame': map_frame,
        'child_frame': query.child_frame, 'status': found.status.value, 'reason': found.reason,
        # one that nothing agrees with is nothing to build on
        'pose': row(found.T_map_sensor) if stated and found.T_map_sensor is not None else None,
        'three_sigma': (3 * np.sqrt(np.diag(found.covariance))).tolist()
        if stated and found.covariance is not None else None,
        'confidence': found.confidence,
        'alternatives': [row(place.T_map_sensor) for place in found.alternatives],
        'attempts': found.attempts}
