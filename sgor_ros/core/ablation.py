"""What studies switch off: steps of the paper, mechanisms beyond it, and what follows from both.

Nobody who uses the package has to know these: nodes, parameter files and ``--help`` don't show
them.
"""
from dataclasses import dataclass
from typing import ClassVar

from .common.settings import setting
from .common.settings import Settings


@dataclass(frozen=True)
class Ablation(Settings):
    """Switches of the paper's ablations and of ours, and radii and counts that go with them.

    Lengths are those for streets, as in `SgorConfig`, which has these as fields of its own: to
    study one, ``SgorConfig(ground_check=False)``.
    """

    FOR_STUDIES: ClassVar[bool] = True

    drop_isolated: bool = setting(
        True, 'Leave out returns without others around them at the same range, rain, dust and '
        'ghosts (beyond the paper)')

    # secondary ground segmentation (Sec. III-B, Eq. 2-3)
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
    refinement_rounds: int = setting(
        3, 'Times that the refinement fits; the paper: once', minimum=1, maximum=100)
    min_inliers: int = setting(
        10, 'Fewer inliers, or inliers on a line, are a failure; where clouds decide too, the '
        'default asks for 5; 0: neither is asked (beyond the paper)', minimum=0, maximum=10000)

    # on the clouds (beyond the paper)
    local_refinement: bool = setting(
        True, 'Refine on the clouds by GICP, from which a covariance follows')
    gicp_max_correspondence_distance: float = setting(
        0.5, 'Farthest pair of points that the local refinement uses', 'm',
        minimum=0.02, maximum=10.0)
    max_correspondence_distance: float = setting(
        0.6, 'Keypoints with one of the same label nearer than this under the result agree', 'm',
        minimum=0.01, maximum=10.0)
