"""The settings of the mapper."""
from dataclasses import dataclass
from typing import ClassVar

from ..core.common.settings import setting
from ..core.common.settings import Settings


@dataclass(frozen=True)
class MapperAblation(Settings):
    """What only studies of the mapper change."""

    FOR_STUDIES: ClassVar[bool] = True

    near_candidates: int = setting(
        4, 'Keyframes near by to try for each new one', minimum=0, maximum=100)
    alike_candidates: int = setting(
        3, 'Keyframes that look alike to try for each new one, wherever they are', minimum=0,
        maximum=100)
    waiting: int = setting(
        8, 'New keyframes whose candidates may wait to be registered; of more the oldest are put '
        'off for good', minimum=1, maximum=1000)
    trusted_drift: float = setting(
        1.0, 'A loop that agrees with odometry needs no second one where odometry is sure to '
        'within this standard deviation', 'm', minimum=0.0, maximum=100.0)


@dataclass(frozen=True)
class MapperConfig(MapperAblation):
    """Which keyframes are kept, where loops are looked for, and how much work they may be."""

    keyframe_spacing: float = setting(
        5.0, 'A keyframe is kept where there is none nearer: memory is bounded by the space',
        'm', minimum=0.1, maximum=1000.0, group='map')
    loop_radius: float = setting(
        20.0, 'Loops are looked for among keyframes within this and what is uncertain of the pose',
        'm', minimum=0.1, maximum=1000.0, group='map')
    registrations_per_scan: int = setting(
        2, 'Candidates of loops to register with each scan; 0: no loops', minimum=0, maximum=1000,
        group='map')
