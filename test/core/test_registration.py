"""Two scans in, transformation out: the street, whose truth is known."""
import json

from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import InputError
from sgor_ros import preprocess
from sgor_ros import register
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import Status
from sgor_ros.core.config import PREPARATION


@pytest.fixture(scope='module')
def scans(street):
    return [SemanticScan(points, labels) for points, labels, _ in street]


@pytest.fixture(scope='module')
def prepared(scans):
    return [preprocess(scan) for scan in scans]


def turned(scan, R):
    """Return the scan of a sensor that is mounted turned by the inverse of R."""
    return SemanticScan(scan.points @ R.T, scan.labels)


def truth_of(street, source, target, R_source=None, R_target=None):
    """Return T_target_source of two scans, each turned."""
    T = relative(street[target][2], street[source][2])
    A, B = np.eye(4), np.eye(4)
    A[:3, :3] = np.eye(3) if R_source is None else R_source
    B[:3, :3] = np.eye(3) if R_target is None else R_target
    return B @ T @ np.linalg.inv(A)


def assert_right(result, truth, metres=0.05, degrees=0.2):
    assert result.success, result.reason
    assert result.reason == ''
    found = errors(result.T_target_source, truth)
    assert found[0] < metres
    assert found[1] < degrees


def assert_refused(result):
    """A reason in words, and no identity that somebody might use."""
    assert result.status in (Status.REFUSED, Status.NO_SOLUTION)
    assert (result.status is Status.NO_SOLUTION) == (result.T_target_source is None)
    assert result.reason
    assert result.alternatives == ()
    assert len(result.degenerate) == 0
    assert result.T_target_source is None or not np.allclose(result.T_target_source, np.eye(4))


@pytest.mark.parametrize('seed', range(5))
def test_any_yaw(scans, street, seed):
    """Two sensors turned by anything: 5 cm and 0.2 degrees, without a guess."""
    rng = np.random.default_rng(seed)
    source, target = rng.permutation(4)[:2]
    R_source, R_target = (Rotation.from_euler('z', a).as_matrix()
                          for a in rng.uniform(-np.pi, np.pi, 2))
    result = register(turned(scans[source], R_source), turned(scans[target], R_target))
    assert_right(result, truth_of(street, source, target, R_source, R_target))


@pytest.mark.parametrize('angles', [(0.3, 0.4, 0.0), (2.0, -0.3, 0.3), (1.0, 0.0, 1.4)])
def test_any_mounting(scans, street, angles):
    """A rigid motion of the input moves the answer, tilted and sideways sensors too."""
    R = Rotation.from_euler('zyx', angles).as_matrix()
    plain = register(scans[2], scans[0])
    both = register(turned(scans[2], R), turned(scans[0], R))
    one = register(turned(scans[2], R), scans[0])
    assert_right(both, truth_of(street, 2, 0, R, R))
    assert_right(one, truth_of(street, 2, 0, R))
    M = np.eye(4)
    M[:3, :3] = R
    metres, degrees = errors(one.T_target_source @ M, plain.T_target_source)
    assert metres < 0.03
    assert degrees < 0.1


def test_points_of_a_base_frame(scans, street):
    """Points given in a frame on the ground, where the plane runs through the origin."""
    lifted = [SemanticScan(scan.points + np.float32([1.0, 0, 1.73]), scan.labels)
              for scan in scans]
    T_base_sensor = np.eye(4)
    T_base_sensor[:3, 3] = 1.0, 0, 1.73
    result = register(lifted[2], lifted[0])
    assert_right(result, T_base_sensor @ truth_of(street, 2, 0) @ np.linalg.inv(T_base_sensor))


def test_both_directions_are_inverse_to_each_other(prepared):
    for i, j in ((1, 0), (3, 0), (3, 1)):
        there, back = register(prepared[i], prepared[j]), register(prepared[j], prepared[i])
        metres, degrees = errors(there.T_target_source @ back.T_target_source, np.eye(4))
        assert metres < 0.05
        assert degrees < 0.1


EXACT = ('source_points', 'target_points', 'inliers')
EXACT_OF_THE_SOLUTION = ('hypotheses', 'passed_ground_check', 'best_hypothesis')


@pytest.mark.parametrize(('threads', 'rounding'), [(1, 0.0), (2, 1e-9)])
def test_the_same_input_gives_the_same_output(scans, threads, rounding):
    """Bit by bit but for the sums of GICP, whose order is left to its threads."""
    config = SgorConfig(threads=threads)
    first, again = register(scans[1], scans[0], config), register(scans[1], scans[0], config)
    ready = register(preprocess(scans[1], config), preprocess(scans[0], config), config)
    for other in (again, ready):
        for name in EXACT:
            np.testing.assert_array_equal(getattr(first, name), getattr(other, name), err_msg=name)
        for name in ('T_target_source', 'covariance', 'confidence'):
            np.testing.assert_allclose(getattr(first, name), getattr(other, name), rtol=rounding,
                                       atol=rounding, err_msg=name)
        for name in EXACT_OF_THE_SOLUTION:
            np.testing.assert_array_equal(getattr(first.solution, name),
                                          getattr(other.solution, name), err_msg=name)


def test_a_scan_with_itself_is_the_identity(prepared):
    result = register(prepared[0], prepared[0])
    assert result.success
    assert result.confidence > 0.98
    np.testing.assert_allclose(result.T_target_source, np.eye(4), atol=1e-3)


def test_what_the_result_tells(prepared, street):
    """Inliers lie where the transformation brings them, the winner is one of the hypotheses."""
    result = register(prepared[1], prepared[0])
    T = result.T_target_source
    residual = np.linalg.norm(result.source_points @ T[:3, :3].T + T[:3, 3]
                              - result.target_points, axis=1)
    np.testing.assert_array_equal(result.inliers, residual < SgorConfig().tau_1)
    assert result.solution.passed_ground_check[result.solution.best_hypothesis]
    best = result.solution.hypotheses[result.solution.best_hypothesis]
    metres, degrees = errors(best, truth_of(street, 1, 0))
    assert metres < 1.0
    assert degrees < 3.0
    assert result.source_ground is prepared[1].ground
    assert result.target_ground is prepared[0].ground
    assert result.warnings == ()
    assert np.linalg.eigvalsh(result.covariance).min() > 0
    assert {'matching', 'verification', 'alignment'} <= set(result.timings)
    assert all(seconds > 0 for seconds in result.timings.values())


def half_random(scan, seed):
    rng = np.random.default_rng(seed)
    wrong = rng.random(len(scan)) < 0.5
    return SemanticScan(scan.points, np.where(wrong, rng.choice(np.unique(scan.labels), len(scan)),
                                              scan.labels))


@pytest.mark.parametrize(('source', 'target'), [(1, 0), (3, 0), (2, 3)])
def test_half_of_all_labels_wrong(scans, street, source, target):
    result = register(half_random(scans[source], 0), half_random(scans[target], 1))
    assert_right(result, truth_of(street, source, target))


def test_no_labels_at_all(scans, street):
    """It registers, both planes say how they were found, and nothing is warned of."""
    result = register(SemanticScan(scans[3].points), SemanticScan(scans[0].points))
    assert_right(result, truth_of(street, 3, 0))
    assert result.source_ground.source == result.target_ground.source == 'geometry'
    assert result.warnings == ()


def test_labels_without_a_ground_among_them_are_told(scans):
    points, labels = scans[0].points, scans[0].labels
    walls = np.where(np.isin(labels, (40, 44, 48, 49, 72)), 0, labels)
    assert 'no ground labels: ground plane found by geometry' in preprocess(
        SemanticScan(points, walls)).warnings


@pytest.mark.parametrize('labelled', ['source', 'target'])
def test_labels_in_one_scan_only(scans, street, labelled):
    """There are no common classes; it is no worse than without labels."""
    bare = [SemanticScan(scan.points) for scan in scans]
    source, target = (scans[1], bare[0]) if labelled == 'source' else (bare[1], scans[0])
    assert_right(register(source, target), truth_of(street, 1, 0))


def without(scan, way, seed):
    """Return a scan some of whose labels are missing: 0 in their place."""
    rng = np.random.default_rng(seed)
    azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0])
    ids = np.unique(scan.labels)
    gone = {'all': np.ones(len(scan), bool), 'random 90 %': rng.random(len(scan)) < 0.9,
            'a side': np.sin(azimuth - rng.uniform(-np.pi, np.pi)) > 0,
            'classes': np.isin(scan.labels, ids[rng.random(len(ids)) < 0.5])}[way]
    return SemanticScan(scan.points, np.where(gone, 0, scan.labels))


@pytest.mark.parametrize('way', ['all', 'random 90 %', 'a side', 'classes'])
@pytest.mark.parametrize('both', [False, True])
def test_missing_labels_weaken_and_never_contradict(scans, street, way, both):
    """Whole scans, points, a half of the view or classes: as right and as sure as without."""
    source = without(scans[3], way, 0)
    target = without(scans[0], way, 1) if both else scans[0]
    result = register(source, target)
    assert_right(result, truth_of(street, 3, 0))
    assert result.confidence > 0.93
    says = 'labels ignored: the source has none'
    assert (says in result.warnings) == (way == 'all' and not both)


def test_one_label_for_everything_is_no_label(scans, street):
    """In some conventions id 0 is a class: a network that dropped out calls everything a car."""
    config = SgorConfig(label_convention='semantickitti_train')
    dropped = preprocess(SemanticScan(scans[1].points, np.zeros(len(scans[1]), int)), config)
    assert dropped.features.labelled_share == 0
    assert 'every point is car: treated as unlabelled' in dropped.warnings
    assert_right(register(dropped, preprocess(scans[0])), truth_of(street, 1, 0))


ABLATIONS = {
    'without preprocessing': {'correspondence_preprocessing': False},
    'ground by labels only': {'secondary_ground': False},
    'geometry only': {'semantics': 'none'},
    'hard semantics': {'semantics': 'hard'},
    'without ground check': {'ground_check': False},
    'matching across labels': {'match_within_labels': False},
    'matching across heights': {'height_gate': 0.0},
    'without context': {'context_weight': 0.0},
    'one attempt': {'quick_keypoints': 0, 'max_correspondences': 1600},
    'truncated distance': {'cloud_check': False},
    'without local refinement': {'local_refinement': False},
    'movers vote': {'moving_vote': True},
    'plane as printed': {'robust_ground': False},
}


@pytest.mark.parametrize('changes', ABLATIONS.values(), ids=ABLATIONS)
def test_each_ablation_runs_and_registers(scans, street, changes):
    """One setting turned off loses no pair as easy as this one."""
    config = SgorConfig().replace(**changes)
    result = register(scans[1], scans[0], config)
    assert_right(result, truth_of(street, 1, 0), 0.3, 1.0)


def test_the_paper_registers(scans, street):
    result = register(scans[1], scans[0], SgorConfig.paper())
    assert_right(result, truth_of(street, 1, 0), 0.3, 1.0)
    assert result.covariance is None


def test_ablations_change_what_they_say(scans):
    """Each is seen in the result at the place that it is about."""
    def run(**changes):
        # a second attempt with all keypoints would say the same and take longer
        return register(scans[1], scans[0], SgorConfig(max_correspondences=1500, **changes))

    def heights(result, side):
        ground = getattr(result, f'{side}_ground')
        return ground.heights(getattr(result, f'{side}_points'))

    default = run()
    assert np.abs(heights(default, 'source')).min() >= SgorConfig().sigma_g
    assert np.abs(heights(run(correspondence_preprocessing=False), 'source')).min() < 0.1

    road = default.source_ground.mask.sum()
    assert run(secondary_ground=False).source_ground.mask.sum() != road

    assert not run(sigma_theta=0.005).solution.passed_ground_check.all()
    assert run(sigma_theta=0.005, ground_check=False).solution.passed_ground_check.all()

    gap = np.abs(heights(default, 'source') - heights(default, 'target'))
    assert gap.max() <= SgorConfig().height_gate + 1e-9
    free = run(height_gate=0.0)
    assert np.abs(heights(free, 'source') - heights(free, 'target')).max() > 1.0

    assert len(default.source_points) <= SgorConfig().quick_keypoints
    assert len(run(quick_keypoints=0).source_points) > 1.4 * SgorConfig().quick_keypoints

    def right(result):
        return result.inliers.mean()
    assert right(run(match_within_labels=False)) < right(default)
    assert right(run(context_weight=0.0)) < right(default)

    assert default.covariance is not None
    assert run(local_refinement=False).covariance is None

    noisy = [half_random(scan, i) for i, scan in enumerate(scans[:2])]
    kept = [register(*noisy, SgorConfig(semantics=kind, match_within_labels=False,
                                        max_correspondences=1500)).solution.hypotheses
            for kind in ('loose', 'hard', 'none')]
    assert not np.array_equal(kept[0], kept[1])
    assert not np.array_equal(kept[0], kept[2])
    assert not np.array_equal(kept[1], kept[2])


def test_confidence_decides(prepared):
    """The threshold refuses, and the reason names it; the candidate is still there to look at."""
    few = SgorConfig(max_correspondences=1000)
    result = register(prepared[1], prepared[0], few.replace(min_confidence=1.0))
    assert_refused(result)
    assert 'min_confidence 1.00' in result.reason
    assert result.T_target_source is not None
    result = register(prepared[1], prepared[0], few.replace(min_inliers=10000))
    assert_refused(result)
    # several matches on one point count once
    count = int(result.reason.split()[1])
    assert 100 < count <= result.inliers.sum()
    shared = f': {result.solution.inliers.sum()} matches agree, at {count} points'
    assert result.reason.removesuffix(shared) == f'only {count} inliers, min_inliers is 10000'


@pytest.mark.parametrize('labels', [True, False])
def test_another_place_is_refused(scans, elsewhere, labels):
    for scan, (points, ids, _) in zip(scans[:2], elsewhere[:2], strict=True):
        pair = ((scan, SemanticScan(points, ids)) if labels else
                (SemanticScan(scan.points), SemanticScan(points)))
        for source, target in (pair, pair[::-1]):
            assert_refused(register(source, target))


@pytest.mark.parametrize('seed', range(3))
def test_random_points_are_refused(prepared, seed):
    """With labels of a street and none of its shapes, in both directions."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-40, -40, -2], [40, 40, 8], (20000, 3))
    noise = preprocess(SemanticScan(points, rng.choice(prepared[0].scan.labels, 20000)))
    assert_refused(register(noise, prepared[0]))
    assert_refused(register(prepared[0], noise))


@pytest.mark.parametrize('points', [[[5, 0, 0]], [[5, 0, 0]] * 1000, [[0, 0, 0]],
                                    [[5, i, 0] for i in range(5)],
                                    [[5, i, 0] for i in range(60)]])
def test_scans_of_next_to_nothing_are_refused(prepared, points):
    """One point, one point often, the sensor itself, a line: a reason and no exception."""
    little = SemanticScan(points, np.full(len(points), 50))
    for source, target in ((little, prepared[0]), (prepared[0], little), (little, little)):
        assert_refused(register(source, target))


def other_preparations():
    """Yield each setting that scans are prepared with, and another value of it."""
    for name in PREPARATION:
        value = getattr(SgorConfig(), name)
        if name != 'label_convention':    # labels are classes by then
            yield name, {bool: lambda v: not v, int: lambda v: v - 10, float: lambda v: v * 0.9,
                         str: lambda v: 'point'}[type(value)](value)


@pytest.mark.parametrize(('name', 'value'), list(other_preparations()))
def test_a_scan_that_was_prepared_otherwise_is_refused_by_name(prepared, name, value):
    before = getattr(SgorConfig(), name)
    with pytest.raises(InputError) as caught:
        register(prepared[1], prepared[0], SgorConfig(**{name: value}))
    assert str(caught.value) == (
        f'source: prepared with {name} = {before!r}, not with {value!r}; preprocess it with the '
        'configuration of the registration')


def test_one_scan_that_was_prepared_otherwise_is_named(prepared, scans):
    other = preprocess(scans[1], SgorConfig(voxel_size=0.4))
    with pytest.raises(InputError, match=r'^target: prepared with voxel_size = 0\.4, not with'):
        register(prepared[0], other)
    with pytest.raises(InputError, match=r'^source: prepared at scale 1, not at 0\.5'):
        register(prepared[1], prepared[0], SgorConfig(scale=0.5))


def test_what_only_registration_asks_may_change(prepared):
    changed = SgorConfig(min_confidence=0.5, hypothesis_radius=20.0, quick_keypoints=0, threads=1)
    assert register(prepared[1], prepared[0], changed).success


def test_prepared_scans_bring_their_configuration(scans):
    """Without one, theirs counts: not the default."""
    config = SgorConfig(voxel_size=0.6, min_confidence=1.0)
    source, target = preprocess(scans[1], config), preprocess(scans[0], config)
    for found in (register(source, target), register(scans[1], target)):
        assert found.status is Status.REFUSED
        assert 'min_confidence 1.00' in found.reason
    assert register(source, target, config.replace(min_confidence=0.85)).success


def test_a_result_as_json_and_what_it_does_to_points(scans, street):
    result = register(scans[3], scans[0])
    told = json.loads(json.dumps(result.to_dict()))
    assert told['success']
    np.testing.assert_array_equal(told['T_target_source'], result.T_target_source)
    assert told['inliers'] == result.inliers.sum()
    moved = result.transform(street[3][0])
    world = [points @ T[:3, :3].T + T[:3, 3] for points, T in (
        (moved, street[0][2]), (street[3][0], street[3][2]))]
    assert np.abs(world[0] - world[1]).max() < 0.5
    np.testing.assert_allclose(result.transform([0.0, 0.0, 0.0]), result.T_target_source[:3, 3])
    with pytest.raises(InputError, match=r'expected an \(N, 3\) array, got shape \(3, 2\)'):
        result.transform(np.zeros((3, 2)))
    rng = np.random.default_rng(0)
    refused = register(*(rng.uniform(-30, 30, (5000, 3)) for _ in range(2)))
    told = json.loads(json.dumps(refused.to_dict()))
    assert (told['success'], told['T_target_source']) == (False, None)
    with pytest.raises(InputError, match='transform: not registered: '):
        refused.transform(np.zeros((1, 3)))
