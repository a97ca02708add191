"""What node and replay need to know of the clouds that they take and the poses they give."""
from dataclasses import dataclass

from ..core.common.settings import InputError
from ..core.common.settings import setting
from ..core.common.settings import Settings
from ..core.scan.point_clouds import LABEL_FIELDS
from .frames import parse_transform
from .label_field import AUTO
from .time_field import TIME_FIELDS


@dataclass(frozen=True)
class StreamConfig(Settings):
    """Field of the labels and names of the frames."""

    label_field: str = setting(
        AUTO, 'Field of the clouds that holds the class ids; auto: the first of '
        f'{", ".join(LABEL_FIELDS)} that a cloud has; none: work without labels', common=True)
    time_field: str = setting(
        AUTO, 'Field of the clouds with the time of each point, by which scans are deskewed; '
        f'auto: the first of {", ".join(TIME_FIELDS)} that a cloud has; none: for clouds that are '
        'deskewed already, or sensors at rest')
    odom_frame: str = setting(
        'odom', 'Frame of the published poses; its origin is the first scan')
    map_frame: str = setting(
        'map', 'Frame of the corrected poses, where loops are closed')
    sensor_frame: str = setting(
        '', 'Frame of the sensor in what is published; empty: the frame_id of each scan')
    base_frame: str = setting(
        '', 'Frame whose odometry is published, such as base_link; empty: the frame of the sensor',
        common=True)
    T_base_sensor: str = setting(
        '', 'Pose of the sensor in base_frame, x y z roll pitch yaw as in a URDF, m and rad; '
        'empty: the node looks it up in tf2 at the stamp of each scan. It tells which way is up; '
        'and where the sensor is in clouds that lie in base_frame already', common=True)

    def __post_init__(self) -> None:
        """Check the frames too."""
        super().__post_init__()
        for name in ('odom_frame', 'map_frame'):
            if not getattr(self, name):
                raise InputError(f"{name} = '': a frame needs a name")
        if self.T_base_sensor:
            parse_transform(self.T_base_sensor, 'T_base_sensor')
            if not self.base_frame:
                raise InputError(f'T_base_sensor = {self.T_base_sensor!r}: it needs a base_frame')
        for name in ('odom_frame', 'map_frame', 'sensor_frame', 'base_frame'):
            if getattr(self, name).startswith('/'):
                raise InputError(f'{name} = {getattr(self, name)!r}: frame ids have no leading '
                                 'slash')
