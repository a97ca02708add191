"""The settings of SGOR: one home for each default, with unit, meaning and bounds."""
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
import math
from typing import Self

from .ablation import Ablation
from .common.settings import InputError
from .common.settings import renamed
from .common.settings import setting
from .common.settings import Value

PAPER_STEPS: dict[str, Value] = {
    'drop_isolated': False, 'labelled_ground': True, 'robust_ground': False,
    'drop_ground_labels': 'point',
    'sampled_keypoints': True, 'quick_keypoints': 0, 'match_within_labels': False,
    'unlabelled_attempt': False, 'height_gate': 0.0, 'context_weight': 0.0, 'moving_vote': True,
    'weight_cutoff': 6.0, 'cloud_check': False, 'refinement_rounds': 1,
    'local_refinement': False, 'min_inliers': 0, 'hypothesis_radius': 0.0, 'min_confidence': 0.0}
"""Each of them the paper, where the default goes beyond it; and a fixed scale."""


@renamed(rival_radius='hypothesis_radius', evidence_reach='max_correspondence_distance',
         local_reach='gicp_max_correspondence_distance')
@dataclass(frozen=True)
class SgorConfig(Ablation):
    """Settings of preprocessing and registration; ``SgorConfig()`` is for any space.

    Lengths are those for streets; ``scaled`` fits them to smaller spaces. Where the paper prints
    no value (all radii and sizes), the defaults were measured; see ``docs/method.md``. What only
    studies change are the fields of `Ablation`.
    """

    scale: float = setting(
        0.0, 'All lengths but max_range are those for streets and are multiplied by this; 0: it '
        'follows from the scans, 1 for streets and courtyards, a half for corridors, and so on',
        minimum=0.0, maximum=10.0, group='space')
    label_convention: str = setting(
        'semantickitti', 'What the label ids mean: semantickitti, semantickitti_train, nuscenes, '
        'nuscenes16, autoware_frnet, autoware_ptv3, carla, rellis or the path of a TOML, '
        'JSON or YAML file',
        group='sensor', common=True)
    min_range: float = setting(
        1.0, 'Points nearer to the sensor are dropped', 'm', minimum=0.0, maximum=100.0,
        group='sensor')
    max_range: float = setting(
        80.0, 'Points farther from the sensor are dropped', 'm', minimum=0.5, maximum=1000.0,
        group='sensor', common=True)
    voxel_size: float = setting(
        0.5, 'Edge of the voxel grid that thins a scan', 'm', minimum=0.01, maximum=10.0,
        group='sensor', common=True)
    sigma_g: float = setting(
        0.25, 'Points nearer to the ground plane are ground', 'm', minimum=0.005, maximum=5.0,
        group='thresholds')
    sigma_d: float = setting(
        0.4, 'Two correspondences are consistent when their lengths differ by less', 'm',
        minimum=0.005, maximum=5.0, group='thresholds')
    sigma_theta: float = setting(
        math.radians(5.0), 'Largest angle between the ground normals', 'rad',
        minimum=0.001, maximum=math.pi, group='thresholds')
    tau_1: float = setting(
        0.6, 'Correspondences nearer than this under the best hypothesis refine it', 'm',
        minimum=0.005, maximum=5.0, group='thresholds')
    min_confidence: float = setting(
        0.85, 'Results that are right with less probability are failures: at 0.85 a wrong one '
        'costs what six right ones are worth; 0: accept all',
        minimum=0.0, maximum=1.0, group='trust', common=True)
    hypothesis_radius: float = setting(
        30.0, 'Other placements that explain the scans are looked for so far from the answer; 0: '
        'not at all (beyond the paper)', 'm', minimum=0.0, maximum=500.0, group='trust')
    max_correspondences: int = setting(
        8000, 'Keypoints to match; more are thinned evenly', minimum=10, maximum=50000,
        group='speed')
    max_voxels: int = setting(
        40000, 'Voxels of a scan; more are thinned evenly, so that any cloud ends in time',
        minimum=100, maximum=1000000, group='speed')
    threads: int = setting(
        2, 'Processor cores to use', minimum=1, maximum=64, group='speed', common=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        # one neighbour search serves all three
        for name in ('normal_radius', 'vote_radius'):
            if getattr(self, name) > self.descriptor_radius:
                raise InputError(f'{name} = {getattr(self, name)}: larger than '
                                 f'descriptor_radius = {self.descriptor_radius}')
        if self.group_keep >= self.group_size:
            raise InputError(f'group_keep = {self.group_keep}: not below '
                             f'group_size = {self.group_size}')

    def scaled(self, scale: float) -> Self:
        """Return the settings for a space that is `scale` times the size of a street."""
        scaled: Self = _scaled(self, scale)
        return scaled

    @classmethod
    def outdoor(cls) -> Self:
        """Return the default, which follows the scale of the scans."""
        return cls()

    @classmethod
    def indoor(cls) -> Self:
        """Return a preset for matches of rooms, which have no clouds to find the scale from.

        For `register_correspondences`, and protocols that fix it. Of scans the default finds the
        scale, and registers more of them.
        """
        return cls(
            scale=1.0, min_range=0.0, max_range=20.0, voxel_size=0.05, sigma_g=0.03,
            normal_radius=0.10, descriptor_radius=0.25, vote_radius=0.10, context_scale=0.15,
            height_gate=0.0, key_spacing=0.1, sigma_d=0.10, tau_1=0.10, ground_check=False,
            gicp_max_correspondence_distance=0.10, max_correspondence_distance=0.10,
            hypothesis_radius=5.0)

    @classmethod
    def paper(cls) -> Self:
        """Return the paper: its steps, and what it does not print as in the default."""
        return cls().paper_steps()

    @classmethod
    def kitti_protocol(cls) -> Self:
        """Return the paper behind the front end that its relatives print for KITTI.

        Voxels of 0.3 m, normals of 0.6 m, descriptors of 1.5 m, 8,000 points of each scan.
        """
        return cls.paper().replace(voxel_size=0.3, normal_radius=0.6, descriptor_radius=1.5,
                                   max_correspondences=8000)

    def paper_steps(self) -> Self:
        """Return these settings with all that is beyond the paper off, to compare features by.

        Lengths, thresholds and ablations stay; nothing is refused.
        """
        return self.replace(scale=self.scale or 1.0, **PAPER_STEPS)


PREPARATION = (
    'label_convention', 'min_range', 'max_range', 'drop_isolated', 'voxel_size', 'max_voxels',
    'sigma_g', 'secondary_ground', 'labelled_ground', 'robust_ground', 'ground_radius',
    'min_ground_points', 'correspondence_preprocessing', 'drop_ground_labels', 'normal_radius',
    'descriptor_radius', 'vote_radius', 'context_weight', 'context_scale', 'moving_vote',
    'max_correspondence_distance')
"""What a scan is prepared with, besides the scale: registrations that differ in it cannot share
one."""


def prepares_alike(one: SgorConfig, other: SgorConfig) -> bool:
    """Return whether a scan prepared with one configuration serves the other."""
    return all(getattr(one, name) == getattr(other, name) for name in (*PREPARATION, 'scale'))


def first_difference(one: SgorConfig, other: SgorConfig, names: Sequence[str] = PREPARATION
                     ) -> str:
    """Return the first setting that scans of both cannot be registered for; empty: none.

    Label conventions may differ: labels are classes by then.
    """
    return next((name for name in names if name != 'label_convention'
                 and getattr(one, name) != getattr(other, name)), '')


@lru_cache(maxsize=32)
def _scaled[Config: SgorConfig](config: Config, scale: float) -> Config:
    lengths = {}
    for item in config.settings():
        if item.unit == 'm' and item.name != 'max_range' and scale != 1:
            length = getattr(config, item.name) * scale
            # what is off stays off; else a length is never beyond its bounds
            lengths[item.name] = length and min(max(length, item.minimum or 0.0),
                                                item.maximum or math.inf)
    return config.replace(scale=1.0, **lengths)
