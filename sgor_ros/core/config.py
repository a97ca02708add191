"""The settings of SGOR: one home for each default, with unit, meaning and bounds."""
from dataclasses import dataclass
from functools import lru_cache
import math
from typing import Self

from .common.settings import InputError
from .common.settings import setting
from .common.settings import Settings
from .common.settings import Value

PAPER_STEPS: dict[str, Value] = {
    'labelled_ground': True, 'robust_ground': False, 'drop_ground_labels': 'point',
    'sampled_keypoints': True, 'quick_keypoints': 0, 'match_within_labels': False,
    'unlabelled_attempt': False, 'height_gate': 0.0, 'context_weight': 0.0, 'moving_vote': True,
    'weight_cutoff': 6.0, 'cloud_check': False, 'refinement_rounds': 1,
    'local_refinement': False, 'min_inliers': 0, 'rival_radius': 0.0, 'min_confidence': 0.0}
"""Each of them the paper, where the default goes beyond it; and a fixed scale."""


@dataclass(frozen=True)
class SgorConfig(Settings):
    """Settings of preprocessing and registration; ``SgorConfig()`` is for any space.

    Lengths are those for streets; ``scaled`` fits them to smaller spaces. Where the paper prints
    no value (all radii and sizes), the defaults were measured; see ``docs/method.md``.
    """

    scale: float = setting(
        0.0, 'All lengths but max_range are those for streets and are multiplied by this; 0: it '
        'follows from the scans, 1 for streets and courtyards, a half for corridors, and so on',
        minimum=0.0, maximum=10.0)

    # scan -> semantic-geometric space (Sec. III-B)
    label_convention: str = setting(
        'semantickitti', 'What the label ids mean: semantickitti, semantickitti_train, nuscenes, '
        'nuscenes16, autoware_frnet, autoware_ptv3, carla, rellis or the path of a YAML file')
    min_range: float = setting(
        1.0, 'Points nearer to the sensor are dropped', 'm', minimum=0.0, maximum=100.0)
    max_range: float = setting(
        80.0, 'Points farther from the sensor are dropped', 'm', minimum=0.5, maximum=1000.0)
    voxel_size: float = setting(
        0.5, 'Edge of the voxel grid that thins a scan', 'm', minimum=0.01, maximum=10.0)
    max_voxels: int = setting(
        40000, 'Voxels of a scan; more are thinned evenly, so that any cloud ends in time',
        minimum=100, maximum=1000000)

    # secondary ground segmentation (Sec. III-B, Eq. 2-3)
    sigma_g: float = setting(
        0.25, 'Points nearer to the ground plane are ground', 'm', minimum=0.005, maximum=5.0)
    secondary_ground: bool = setting(
        True, 'Segment the ground a second time by distance; false: by labels only (ablation 3)')
    labelled_ground: bool = setting(
        False, 'Of the points near the plane only those with a ground label are ground, the '
        'narrow reading of Eq. 3; false: each is, the wide one')
    robust_ground: bool = setting(
        True, 'Find the ground plane by consensus of voxels near the sensor, and by geometry '
        'where there are no ground labels (beyond the paper); false: SVD of all ground points')
    ground_radius: float = setting(
        25.0, 'Horizontal reach of the ground plane fit when robust_ground is on', 'm',
        minimum=1.0, maximum=1000.0)
    min_ground_points: int = setting(
        50, 'With fewer voxels there is no ground plane', minimum=3, maximum=100000)

    # features and correspondences (Sec. III-B)
    correspondence_preprocessing: bool = setting(
        True, 'Leave out ground and classes that only one scan has; false: ablation 1')
    drop_ground_labels: str = setting(
        'regional', 'Which ground labels off the plane stay out of matching too: point, those of '
        'single points (Eq. 4); regional, those of the vote; none', choices=(
            'regional', 'point', 'none'))
    normal_radius: float = setting(
        1.5, 'Neighbourhood of a normal', 'm', minimum=0.01, maximum=20.0)
    descriptor_radius: float = setting(
        3.5, 'Neighbourhood of an FPFH descriptor', 'm', minimum=0.02, maximum=50.0)
    vote_radius: float = setting(
        1.0, 'Neighbourhood of the regional label vote', 'm', minimum=0.0, maximum=20.0)
    max_correspondences: int = setting(
        8000, 'Keypoints to match; more are thinned evenly', minimum=10, maximum=50000)
    sampled_keypoints: bool = setting(
        False, 'Draw max_correspondences keypoints of each scan at random, as the protocols of '
        'KITTI do; false: those of the source are matched to all of the target')
    sampling_seed: int = setting(
        0, 'Of that draw; another one gives another sample', minimum=0, maximum=2**31 - 1)
    quick_keypoints: int = setting(
        1000, 'Keypoints of a first attempt; all are matched only when that is refused. 0: no '
        'first attempt (beyond the paper)', minimum=0, maximum=50000)
    quick_groups: int = setting(
        25, 'Groups of the first attempt', minimum=1, maximum=5000)
    match_within_labels: bool = setting(
        True, 'Match only points of the same regional label (beyond the paper)')
    unlabelled_attempt: bool = setting(
        True, 'Match what is refused once more by geometry alone, or, where there are no labels, '
        'without the context (beyond the paper)')
    height_gate: float = setting(
        0.5, 'Match only points whose heights over the ground differ by less; 0: off '
        '(beyond the paper)', 'm', minimum=0.0, maximum=20.0)
    context_weight: float = setting(
        1.5, 'Weight of the semantic context beside the descriptor; 0: off (beyond the paper)',
        minimum=0.0, maximum=100.0)
    context_scale: float = setting(
        1.5, 'Finest of the three scales of the semantic context', 'm', minimum=0.05, maximum=20.0)
    moving_vote: bool = setting(
        False, 'Let movable classes (people, moving cars) take part')

    # grouping (Sec. III-B)
    groups: int = setting(500, 'Key correspondences L', minimum=1, maximum=5000)
    group_size: int = setting(2000, 'Correspondences in a group k', minimum=3, maximum=20000)
    group_keep: int = setting(12, 'Correspondences kept in a group k_1', minimum=3, maximum=1000)
    key_spacing: float = setting(
        1.0, 'Keys nearer to a stronger key give way to others', 'm', minimum=0.0, maximum=20.0)

    # semantic-geometric consistency (Sec. III-C)
    sigma_d: float = setting(
        0.4, 'Two correspondences are consistent when their lengths differ by less', 'm',
        minimum=0.005, maximum=5.0)
    weight_cutoff: float = setting(
        1.0, 'Multiple of sigma_d beyond which the weights W_m are zero', minimum=1.0, maximum=8.0)
    semantics: str = setting(
        'loose', 'Semantic consistency: tight or regional; hard: of single points (ablation 6); '
        'none: geometry only (ablation 5)', choices=('loose', 'hard', 'none'))

    # two-stage verification and refinement (Sec. III-D, III-E)
    cloud_check: bool = setting(
        True, 'Choose among hypotheses by the evidence of the clouds instead of the truncated '
        'distance (beyond the paper)')
    ground_check: bool = setting(
        True, 'Refuse hypotheses that tilt the ground; false: ablation 8')
    sigma_theta: float = setting(
        math.radians(5.0), 'Largest angle between the ground normals', 'rad',
        minimum=0.001, maximum=math.pi)
    tau_1: float = setting(
        0.6, 'Correspondences nearer than this under the best hypothesis refine it', 'm',
        minimum=0.005, maximum=5.0)

    refinement_rounds: int = setting(
        3, 'Times that the refinement fits; the paper: once', minimum=1, maximum=100)

    # local refinement on the clouds and acceptance (beyond the paper)
    local_refinement: bool = setting(
        True, 'Refine on the clouds by GICP, from which a covariance follows')
    local_reach: float = setting(
        0.5, 'Farthest pair of points that the local refinement uses', 'm',
        minimum=0.02, maximum=10.0)
    min_inliers: int = setting(
        10, 'Fewer inliers, or inliers on a line, are a failure; 0: neither is asked (beyond the '
        'paper)', minimum=0, maximum=10000)
    evidence_reach: float = setting(
        0.6, 'Keypoints with one of the same label nearer than this under the result agree', 'm',
        minimum=0.01, maximum=10.0)
    rival_radius: float = setting(
        30.0, 'Other placements that explain the scans are looked for so far from the answer; 0: '
        'not at all (beyond the paper)', 'm', minimum=0.0, maximum=500.0)
    min_confidence: float = setting(
        0.85, 'Results below this confidence are failures; 0: accept all',
        minimum=0.0, maximum=1.0)

    threads: int = setting(2, 'Processor cores to use', minimum=1, maximum=64)

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
        """Return a preset for rooms and fragments of a few metres, for who wants it fixed."""
        return cls(
            scale=1.0, min_range=0.0, max_range=20.0, voxel_size=0.05, sigma_g=0.03,
            normal_radius=0.10, descriptor_radius=0.25, vote_radius=0.10, context_scale=0.15,
            height_gate=0.0, key_spacing=0.1, sigma_d=0.10, tau_1=0.10, ground_check=False,
            local_reach=0.10, evidence_reach=0.10, rival_radius=5.0)

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
