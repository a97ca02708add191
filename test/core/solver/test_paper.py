"""`SgorConfig.paper()` from points to transformation: the dense reference of Eq. 2 to 20."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_consistency import real_matches

from sgor_ros import register
from sgor_ros import register_correspondences
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.features.descriptors import fpfh
from sgor_ros.core.features.descriptors import normals
from sgor_ros.core.features.neighbours import radius_neighbours
from sgor_ros.core.scan.labels import label_convention
from sgor_ros.evaluation import dense_reference as dense

PAPER = SgorConfig.paper()
CONVENTION = label_convention(PAPER.label_convention)
UP = np.array([0, 0, 1.0])


def solver_settings(config):
    """Return what the dense solver asks of a configuration; W_m has no end."""
    return (config.sigma_d, np.inf, config.groups, config.group_size, config.group_keep,
            config.tau_1, config.key_spacing)


def dense_scan(points, ids, config):
    """Return one scan by the dense path: ground normal, keypoints, labels, votes, descriptors."""
    distance = np.linalg.norm(points.astype(float), axis=1)
    near = (distance >= config.min_range) & (distance <= config.max_range)
    points, classes = points[near].astype(float), CONVENTION.decode(ids[near].astype(np.int64))[0]
    assert classes.all()    # each has a label, as in the paper
    means, votes = dense.voxels(points, classes, config.voxel_size)
    labels = votes.argmax(axis=1)
    ground_labels = list(CONVENTION.ground)
    normal, on_ground = dense.ground(points, classes, ground_labels, config.sigma_g,
                                     config.labelled_ground, means, labels)
    means, votes, labels = means[~on_ground], votes[~on_ground], labels[~on_ground]
    regional = dense.regional_labels(means, votes, config.vote_radius)
    off = ~np.isin(labels, ground_labels)    # S_n
    means, labels, regional = means[off], labels[off], regional[off]
    neighbours = radius_neighbours(means, config.descriptor_radius)
    described = fpfh(means, normals(means, neighbours, config.normal_radius), neighbours)
    return normal, means, labels, regional, described


def dense_register(source, target, config):
    """Return T_target_source of two (points, ids), the matches and the normals behind it."""
    sides = [dense_scan(*scan, config) for scan in (source, target)]
    kept = dense.overlap(sides[0][2], sides[1][2], list(CONVENTION.ground))
    rng = np.random.default_rng(config.sampling_seed)
    drawn = [np.flatnonzero(k)[np.sort(rng.permutation(k.sum())[:config.max_correspondences])]
             for k in kept]
    (n_p, p, s_p, r_p, f_p), (n_q, q, s_q, r_q, f_q) = (
        (side[0], *(part[rows] for part in side[1:]))
        for side, rows in zip(sides, drawn, strict=True))
    to = dense.nearest(f_p, f_q)
    T = dense.solve(p, q[to], *solver_settings(config), labels=(s_p, s_q[to]),
                    regional=(r_p, r_q[to]), normals=(n_p, n_q), sigma_theta=config.sigma_theta)
    return T, (p, q[to]), (n_p, n_q)


@pytest.mark.parametrize(('narrow', 'most'), [(True, 8000), (False, 8000), (True, 500)])
def test_two_scans_equal_the_dense_reference(street, narrow, most):
    """Ground, overlap, votes, sample, matches and the transformation of the paper, small."""
    config = PAPER.replace(voxel_size=1.0, max_range=25.0, groups=20, group_size=300,
                           max_correspondences=most, labelled_ground=narrow)
    scans = [street[i][:2] for i in (1, 0)]
    result = register(*(SemanticScan(*scan) for scan in scans), config)
    T, matches, ground_normals = dense_register(*scans, config)
    assert len(matches[0]) > 400
    assert len(matches[0]) == most or most == 8000
    for found, expected in zip((result.source_points, result.target_points), matches, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-6)
    for ground, normal in zip((result.source_ground, result.target_ground), ground_normals,
                              strict=True):
        np.testing.assert_allclose(ground.normal, normal, atol=1e-9)
    np.testing.assert_allclose(result.T_target_source, T, atol=1e-5)
    if most == 8000:
        metres, degrees = errors(T, relative(street[0][2], street[1][2]))
        assert metres < 0.6
        assert degrees < 5


@pytest.mark.parametrize('name', ['000', '010', '020'])
def test_labelled_matches_equal_the_dense_reference(data_folder, name):
    """Real matches with labels, a third of them wrong, and the normals of two grounds."""
    matches, T = real_matches(data_folder, name)
    rows = np.arange(0, len(matches), 3)
    source, target = matches.source[rows], matches.target[rows]
    rng = np.random.default_rng(0)
    ids, classes = np.array([50, 70, 80]), np.array([13, 15, 18])
    # walls and trees in strips, so that neighbours vote alike
    labels = np.array([(np.floor(p / 4).sum(axis=1) % 3).astype(int) for p in (source, source)])
    wrong = rng.random(labels.shape) < 0.3
    labels[wrong] = rng.integers(0, 3, wrong.sum())
    tilt = Rotation.from_euler('x', 2, degrees=True).as_matrix()
    ground_normals = (UP, tilt @ T[:3, :3] @ UP)
    config = PAPER.replace(groups=30, group_size=200)
    result = register_correspondences(source, target, *ids[labels], ground_normals=ground_normals,
                                      config=config)
    regional = [classes[dense.regional_labels(p, np.eye(3)[s], config.vote_radius)]
                for p, s in zip((source, target), labels, strict=True)]
    expected = dense.solve(source, target, *solver_settings(config), labels=classes[labels],
                           regional=regional, normals=ground_normals,
                           sigma_theta=config.sigma_theta)
    assert 0 < result.solution.passed_ground_check.sum() < len(result.solution.passed_ground_check)
    np.testing.assert_allclose(result.T_target_source, expected, atol=1e-5)


def test_the_paper_refuses_nothing():
    """Neither too few inliers nor a line of them, which are ours; the default does."""
    line = np.outer(np.arange(30), [1.0, 0, 0])
    assert 'on a line' in register_correspondences(line, line + 1).reason
    found = register_correspondences(line, line + 1, config=PAPER)
    assert found.success
    few = np.random.default_rng(0).uniform(-9, 9, (5, 3))
    assert 'only 5 inliers' in register_correspondences(few, few + 1).reason
    found = register_correspondences(few, few + 1, config=PAPER)
    assert found.success
    np.testing.assert_allclose(found.T_target_source[:3, 3], 1.0, atol=1e-9)
