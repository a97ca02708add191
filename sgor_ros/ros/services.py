"""What others may ask of the track: the services reset, pause, resume, the topic set_pose."""
import threading

from geometry_msgs.msg import PoseWithCovarianceStamped
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from std_srvs.srv import Trigger

from ..core.common import se3
from ..io.frames import frame_id

Array = NDArray[np.float64]
# a quaternion of this length or more is taken for a rotation
SHORTEST_QUATERNION = 0.5
# float32 of other programs is as exact as that
ROUNDING = 1e-5
# around the earth and beyond
FARTHEST_M = 1e9


class Services:
    """Answers on the executor's thread; the worker takes what was asked for before each scan.

    Attributes
    ----------
    paused : bool
    """

    def __init__(self, node: Node, odom_frame: str) -> None:
        self._log = node.get_logger()
        self._odom_frame = odom_frame
        self._lock = threading.Lock()
        self._reset = False
        self._start: tuple[Array, Array] | None = None
        self.paused = False
        node.create_service(Trigger, 'reset', self._on_reset)
        node.create_service(Trigger, 'pause', self._on_pause)
        node.create_service(Trigger, 'resume', self._on_resume)
        node.create_subscription(PoseWithCovarianceStamped, 'set_pose', self._on_set_pose, 1)

    def take(self) -> tuple[bool, tuple[Array, Array] | None]:
        """Return what was asked for since the last call.

        Returns
        -------
        reset : bool
            Whether a new track is wanted.
        start : ((4, 4) array, (6, 6) array) or None
            Pose and covariance that it begins at, where they were given.
        """
        with self._lock:
            wanted = self._reset, self._start
            self._reset, self._start = False, None
            return wanted

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._reset = True
        return _done(response, 'the next scan starts a new track')

    def _on_pause(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.paused = True
        return _done(response, 'clouds are left out until resume')

    def _on_resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.paused = False
        return _done(response, 'the next scan goes on from the last one before the pause')

    def _on_set_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Begin a new track there with the next scan."""
        start = start_of(message, self._odom_frame)
        if isinstance(start, str):
            self._log.warning(f'set_pose: {start}: ignored')
            return
        with self._lock:
            self._reset = True
            self._start = start
        self._log.info('set_pose: the next scan starts a new track there')


def start_of(message: PoseWithCovarianceStamped, expected_frame: str
             ) -> tuple[Array, Array] | str:
    """Return the (4, 4) pose and (6, 6) covariance of a message, or what is wrong with it.

    A message that names no frame is of the expected one.
    """
    frame = frame_id(message.header.frame_id)
    if frame not in ('', expected_frame):
        return f'in the frame {frame}, not in {expected_frame}'
    x, q = message.pose.pose.position, message.pose.pose.orientation
    position, quaternion = np.array([x.x, x.y, x.z]), np.array([q.x, q.y, q.z, q.w])
    covariance = np.array(message.pose.covariance, np.float64).reshape(6, 6)
    for name, values in (('position', position), ('orientation', quaternion),
                         ('covariance', covariance)):
        if not np.isfinite(values).all():
            return f'its {name} is not finite'
    if np.abs(position).max() > FARTHEST_M:
        return f'its position is {np.abs(position).max():.3g} m away'
    largest = np.abs(quaternion).max()
    if (largest < SHORTEST_QUATERNION / 2
            or np.linalg.norm(quaternion / largest) < SHORTEST_QUATERNION / largest):
        return 'its orientation is no rotation, but a quaternion near zero'
    scale = np.abs(covariance).max()
    if scale > FARTHEST_M**2:
        return f'its covariance has an entry of {scale:.3g}'
    if np.abs(covariance - covariance.T).max() > ROUNDING * scale:
        return 'its covariance is not symmetric'
    covariance = (covariance + covariance.T) / 2
    lowest = float(np.linalg.eigvalsh(covariance)[0])
    if lowest < -ROUNDING * scale:
        return f'its covariance is not positive semidefinite: its least eigenvalue is {lowest:.3g}'
    R = Rotation.from_quat(quaternion / largest).as_matrix()
    return se3.compose(R, position), covariance


def _done(response: Trigger.Response, message: str) -> Trigger.Response:
    response.success = True
    response.message = message
    return response
