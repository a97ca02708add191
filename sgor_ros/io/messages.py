"""ROS messages of results, built from whichever classes are at hand: rclpy's or rosbags'.

``types`` gives the class for a name such as ``'nav_msgs/msg/Odometry'``. The classes of rosbags
want all fields, those of rclpy take them all, so every field is given.
"""
import array
from collections.abc import Callable
from collections.abc import Iterable
import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..core.common import se3
from ..core.verdict.result import Registration
from ..mapping.result import Loop
from ..tracker import TrackedScan
from .pointcloud2 import encode

Types = Callable[[str], Any]

# m^2, rad^2 and their rates: what is not known gets variances that leave it no weight. The -1 of
# sensor_msgs is no covariance, and robot_localization makes an exact measurement of it.
UNKNOWN_VARIANCE = 1e6

# what a person can tell apart in RViz, and what Python can send at 10 Hz
MAX_INLIER_LINES = 1000
MAX_REJECTED_LINES = 300
INLIER_COLOUR = (0.1, 0.85, 0.3, 1.0)
REJECTED_COLOUR = (0.9, 0.15, 0.15, 0.25)
LINE_WIDTH_M = 0.08
LINE_LIST, ADD, DELETE_ALL = 5, 0, 3


def stamp(types: Types, stamp_ns: int) -> Any:
    """Return a builtin_interfaces/msg/Time."""
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return types('builtin_interfaces/msg/Time')(sec=seconds, nanosec=nanoseconds)


def header(types: Types, stamp_ns: int, frame_id: str) -> Any:
    """Return a std_msgs/msg/Header."""
    return types('std_msgs/msg/Header')(stamp=stamp(types, stamp_ns), frame_id=frame_id)


def point_cloud2(types: Types, points: ArrayLike, labels: ArrayLike | None, stamp_ns: int,
                 frame_id: str) -> Any:
    """Return a sensor_msgs/msg/PointCloud2 with x y z and, where given, `label`."""
    cloud = encode(points, labels)
    field = types('sensor_msgs/msg/PointField')
    message = types('sensor_msgs/msg/PointCloud2')
    return message(
        header=header(types, stamp_ns, frame_id), height=1, width=cloud.width,
        fields=[field(name=name, offset=offset, datatype=datatype, count=1)
                for name, offset, datatype in cloud.fields],
        is_bigendian=False, point_step=cloud.point_step, row_step=cloud.data.nbytes,
        data=_byte_array(message, cloud.data), is_dense=True)


def pose(types: Types, T: NDArray[np.float64]) -> Any:
    """Return a geometry_msgs/msg/Pose of a (4, 4) transformation."""
    x, y, z, w = (float(value) for value in Rotation.from_matrix(T[:3, :3]).as_quat())
    return types('geometry_msgs/msg/Pose')(
        position=_point(types('geometry_msgs/msg/Point'), T[:3, 3]),
        orientation=types('geometry_msgs/msg/Quaternion')(x=x, y=y, z=z, w=w))


def matrix_of(pose: Any) -> NDArray[np.float64]:
    """Return the (4, 4) transformation of a geometry_msgs/msg/Pose."""
    return _matrix(pose.position, pose.orientation)


def matrix_of_transform(transform: Any) -> NDArray[np.float64]:
    """Return the (4, 4) transformation of a geometry_msgs/msg/Transform."""
    return _matrix(transform.translation, transform.rotation)


def _matrix(x: Any, q: Any) -> NDArray[np.float64]:
    return se3.compose(Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(),
                       np.array([x.x, x.y, x.z]))


def transform_stamped(types: Types, T: NDArray[np.float64], stamp_ns: int, frame: str,
                      child_frame: str) -> Any:
    """Return a geometry_msgs/msg/TransformStamped of a (4, 4) pose of the child in the frame."""
    vector = types('geometry_msgs/msg/Vector3')
    return types('geometry_msgs/msg/TransformStamped')(
        header=header(types, stamp_ns, frame), child_frame_id=child_frame,
        transform=types('geometry_msgs/msg/Transform')(
            translation=_point(vector, T[:3, 3]), rotation=pose(types, T).orientation))


def tf_message(types: Types, T: NDArray[np.float64], stamp_ns: int, frame: str, child_frame: str
               ) -> Any:
    """Return a tf2_msgs/msg/TFMessage of a (4, 4) pose of the child in the frame."""
    return types('tf2_msgs/msg/TFMessage')(
        transforms=[transform_stamped(types, T, stamp_ns, frame, child_frame)])


def pose_stamped(types: Types, tracked: TrackedScan, odom_frame: str) -> Any:
    """Return a geometry_msgs/msg/PoseStamped of a scan that has a pose."""
    return types('geometry_msgs/msg/PoseStamped')(
        header=header(types, tracked.stamp_ns, odom_frame), pose=pose(types, _pose_of(tracked)))


def odometry(types: Types, tracked: TrackedScan, odom_frame: str, sensor_frame: str) -> Any:
    """Return a nav_msgs/msg/Odometry of a scan that has a pose.

    The twist is in the sensor frame. What is not known has `UNKNOWN_VARIANCE` on the diagonal of
    its covariance.
    """
    return odometry_of(types, _pose_of(tracked), tracked.stamp_ns, odom_frame, sensor_frame,
                       tracked.covariance, tracked.twist, tracked.twist_covariance)


def relative_pose(types: Types, tracked: TrackedScan, sensor_frame: str,
                  reference_frame: str = '') -> Any:
    """Return a nav_msgs/msg/Odometry of the step from a scan to its reference: a graph's edge.

    Both frames carry the stamps of their scans: ``lidar@100200000000`` is where `sensor_frame`
    was then. The pose is that of the scan (child) in the reference, its covariance that of this
    step alone. `reference_frame` is that of the reference where it was another.
    """
    T_reference_sensor = tracked.T_reference_sensor
    assert T_reference_sensor is not None, 'only scans with a step are relative to something'
    return odometry_of(types, T_reference_sensor, tracked.stamp_ns,
                       f'{reference_frame or sensor_frame}@{tracked.reference_stamp_ns}',
                       f'{sensor_frame}@{tracked.stamp_ns}', tracked.reference_covariance)


def loop_closure(types: Types, loop: Loop, sensor_frame: str) -> Any:
    """Return a nav_msgs/msg/Odometry of a loop, in the form of `relative_pose`."""
    return odometry_of(types, loop.T_target_source, loop.source_stamp_ns,
                       f'{sensor_frame}@{loop.target_stamp_ns}',
                       f'{sensor_frame}@{loop.source_stamp_ns}', loop.covariance)


def path(types: Types, stamps_ns: Iterable[int], poses: Iterable[NDArray[np.float64]],
         stamp_ns: int, frame: str) -> Any:
    """Return a nav_msgs/msg/Path of (4, 4) poses."""
    stamped = types('geometry_msgs/msg/PoseStamped')
    return types('nav_msgs/msg/Path')(header=header(types, stamp_ns, frame), poses=[
        stamped(header=header(types, of, frame), pose=pose(types, T))
        for of, T in zip(stamps_ns, poses, strict=True)])


def pose_array(types: Types, poses: Iterable[NDArray[np.float64]], stamp_ns: int, frame: str
               ) -> Any:
    """Return a geometry_msgs/msg/PoseArray of (4, 4) poses."""
    return types('geometry_msgs/msg/PoseArray')(
        header=header(types, stamp_ns, frame), poses=[pose(types, T) for T in poses])


def odometry_of(types: Types, T: NDArray[np.float64], stamp_ns: int, frame: str,
                child_frame: str, covariance: NDArray[np.float64] | None = None,
                twist: NDArray[np.float64] | None = None,
                twist_covariance: NDArray[np.float64] | None = None) -> Any:
    """Return a nav_msgs/msg/Odometry of a (4, 4) pose and a (6,) twist, with covariances."""
    vector = types('geometry_msgs/msg/Vector3')
    velocity = np.zeros(6) if twist is None else twist
    return types('nav_msgs/msg/Odometry')(
        header=header(types, stamp_ns, frame), child_frame_id=child_frame,
        pose=types('geometry_msgs/msg/PoseWithCovariance')(
            pose=pose(types, T), covariance=_covariance(covariance)),
        twist=types('geometry_msgs/msg/TwistWithCovariance')(
            twist=types('geometry_msgs/msg/Twist')(
                linear=_point(vector, velocity[:3]), angular=_point(vector, velocity[3:])),
            covariance=_covariance(None if twist is None else twist_covariance)))


def correspondence_markers(types: Types, tracked: TrackedScan, odom_frame: str) -> Any:
    """Return a visualization_msgs/msg/MarkerArray of the matches of a scan, in the odom frame.

    Each line joins a point of the scan with its match in the reference, both where the track has
    them, so that the line of an inlier is short. A scan without a pose or without a step clears
    the display.
    """
    markers = types('visualization_msgs/msg/MarkerArray')
    step, T_reference_sensor = tracked.registration, tracked.T_reference_sensor
    if tracked.T_odom_sensor is None or step is None or T_reference_sensor is None:
        return markers(markers=[_marker(types, tracked.stamp_ns, odom_frame, '', DELETE_ALL,
                                        REJECTED_COLOUR, [])])
    ends = _ends_in_odom(tracked.T_odom_sensor, T_reference_sensor, step)
    point = types('geometry_msgs/msg/Point')
    shown = []
    for namespace, rows, limit, colour in (
            ('inliers', np.flatnonzero(step.inliers), MAX_INLIER_LINES, INLIER_COLOUR),
            ('rejected', np.flatnonzero(~step.inliers), MAX_REJECTED_LINES, REJECTED_COLOUR)):
        thinned = rows[np.linspace(0, len(rows) - 1, min(limit, len(rows))).astype(int)]
        points = [_point(point, end) for end in ends[thinned].reshape(-1, 3)]
        shown.append(_marker(types, tracked.stamp_ns, odom_frame, namespace, ADD, colour, points))
    return markers(markers=shown)


def _ends_in_odom(T_odom_sensor: NDArray[np.float64], T_reference_sensor: NDArray[np.float64],
                  step: Registration) -> NDArray[np.float64]:
    """Return (K, 2, 3) ends of the matches."""
    T_odom_reference = T_odom_sensor @ se3.inverse(T_reference_sensor)
    return np.stack((se3.transform(T_odom_sensor, step.source_points),
                     se3.transform(T_odom_reference, step.target_points)), axis=1)


def _marker(types: Types, stamp_ns: int, frame: str, namespace: str, action: int,
            colour: tuple[float, float, float, float], points: list[Any]) -> Any:
    """Return a visualization_msgs/msg/Marker: a list of lines in one colour."""
    red, green, blue, alpha = colour
    image = types('sensor_msgs/msg/CompressedImage')
    mesh = types('visualization_msgs/msg/MeshFile')
    nothing = np.empty(0, np.uint8)
    return types('visualization_msgs/msg/Marker')(
        header=header(types, stamp_ns, frame), ns=namespace, id=0, type=LINE_LIST, action=action,
        pose=pose(types, np.eye(4)),
        scale=types('geometry_msgs/msg/Vector3')(x=LINE_WIDTH_M, y=0.0, z=0.0),
        color=types('std_msgs/msg/ColorRGBA')(r=red, g=green, b=blue, a=alpha),
        lifetime=types('builtin_interfaces/msg/Duration')(sec=0, nanosec=0), frame_locked=False,
        points=points, colors=[], texture_resource='',
        texture=image(header=header(types, 0, ''), format='', data=_byte_array(image, nothing)),
        uv_coordinates=[], text='', mesh_resource='',
        mesh_file=mesh(filename='', data=_byte_array(mesh, nothing)),
        mesh_use_embedded_materials=False)


def _pose_of(tracked: TrackedScan) -> NDArray[np.float64]:
    assert tracked.T_odom_sensor is not None, 'only scans with a pose become messages'
    return tracked.T_odom_sensor


def _point(message: Any, xyz: NDArray[np.float64]) -> Any:
    return message(x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))


def _covariance(covariance: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the 36 numbers of a ROS covariance, row by row."""
    if covariance is not None:
        return np.ascontiguousarray(covariance, np.float64).reshape(36)
    return np.diag(np.full(6, UNKNOWN_VARIANCE)).reshape(36)


def _byte_array(message: Any, data: NDArray[np.uint8]) -> Any:
    """Return bytes as the message class wants them: rosbags (dataclasses) numpy, rclpy array."""
    return data if dataclasses.is_dataclass(message) else array.array('B', data.tobytes())
