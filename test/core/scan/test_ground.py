"""Secondary ground segmentation: labels, plane, distance, plane (Sec. III-B)."""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sgor_ros import preprocess
from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros.core.scan.ground import fit_plane
from sgor_ros.core.scan.ground import printed_ground
from sgor_ros.core.scan.ground import segment_ground
from sgor_ros.core.scan.voxels import one_point_voxels

ROAD, BUILDING = 9, 13    # classes inside
ROADS = frozenset({ROAD})


def street(seed=0, tilt=(0.0, 0.0), height=1.7, noise=0.0):
    """Return points and classes of a tilted road between two walls, and its true normal."""
    rng = np.random.default_rng(seed)
    road = np.c_[rng.uniform(-20, 20, (3000, 2)), rng.normal(-height, 0.02, 3000)]
    walls = np.c_[rng.uniform(-20, 20, 2000), rng.choice([-8.0, 8.0], 2000),
                  rng.uniform(-height, 6, 2000)]
    labels = np.repeat([ROAD, BUILDING], [3000, 2000]).astype(np.uint8)
    flip = rng.random(5000) < noise
    labels[flip] = rng.choice([ROAD, BUILDING], flip.sum())
    R = Rotation.from_euler('yx', tilt).as_matrix()
    return np.vstack((road, walls)) @ R.T, labels, R @ [0, 0, 1]


def angle_deg(a, b):
    return np.degrees(np.arccos(np.clip(a @ b, -1, 1)))


def test_plane_of_three_points_by_hand():
    """The plane z = -2 seen from above: normal up, offset 2."""
    normal, offset = fit_plane(np.array([[0, 0, -2.0], [1, 0, -2], [0, 1, -2], [1, 1, -2]]))
    np.testing.assert_allclose(normal, [0, 0, 1], atol=1e-12)
    assert offset == pytest.approx(2.0)


@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.1, -0.05)])
@pytest.mark.parametrize('robust', [True, False])
def test_plane_by_labels(tilt, robust):
    """Normal to half a degree, sensor height to 3 cm, towards the sensor."""
    points, labels, truth = street(tilt=tilt)
    cloud = one_point_voxels(points, labels)
    ground = (segment_ground(cloud, ROADS, SgorConfig()) if robust else
              printed_ground(cloud, points, labels, ROADS, SgorConfig()))
    assert ground.source == 'labels'
    assert angle_deg(ground.normal, truth) < 0.5
    assert ground.offset == pytest.approx(1.7, abs=0.03)
    np.testing.assert_allclose(np.median(ground.heights(points[:3000])), 0.0, atol=0.03)


def test_wrong_labels_hardly_tilt_the_plane():
    """Half of all labels at random: the second segmentation still finds the road."""
    points, labels, truth = street(noise=0.5, tilt=(0.05, 0.02))
    config = SgorConfig()
    cloud = one_point_voxels(points, labels)
    ground = segment_ground(cloud, ROADS, config)
    assert angle_deg(ground.normal, truth) < 1.0
    # ground is what lies on the plane, whatever its label says
    assert ground.mask[:3000].mean() > 0.95
    once = segment_ground(cloud, ROADS, config.replace(secondary_ground=False))
    assert np.array_equal(once.mask, labels == ROAD)
    narrow = segment_ground(cloud, ROADS, config.replace(labelled_ground=True))
    assert np.array_equal(narrow.mask, ground.mask & (labels == ROAD))
    np.testing.assert_array_equal(narrow.normal, ground.normal)


@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.2, 0.1)])
def test_geometry_where_labels_are_missing(tilt):
    """Without labels the road is found among larger walls, and the plane says how."""
    points, labels, truth = street(tilt=tilt)
    ground = segment_ground(one_point_voxels(points, np.zeros_like(labels)), ROADS, SgorConfig())
    assert ground.source == 'geometry'
    assert angle_deg(ground.normal, truth) < 0.5
    prepared = preprocess(SemanticScan(points))
    assert prepared.ground.source == 'geometry'
    assert prepared.warnings == (), 'nothing is missing that there ever was'


def test_no_ground_at_all_is_said():
    """A scan without any plane below registers without the ground check and says so."""
    rng = np.random.default_rng(0)
    points = rng.normal(0, 1, (30, 3)) * 3
    prepared = preprocess(SemanticScan(points))
    assert prepared.ground is None
    assert prepared.features.heights is None
    assert 'no ground plane found: no ground check' in prepared.warnings
