"""What docs/pose_graph.md shows, run in the optimisers: an extra, `pip install .[slam]`."""
from pathlib import Path
import runpy

import numpy as np
import pytest
from rosbags.typesys import get_typestore
from rosbags.typesys import Stores
from scipy.spatial.transform import Rotation

from sgor_ros import SemanticScan
from sgor_ros import Tracker
from sgor_ros.core.common import se3
from sgor_ros.io.messages import odometry_of
from sgor_ros.io.messages import relative_pose

STORE = get_typestore(Stores.ROS2_JAZZY)
EXAMPLES = sorted((Path(__file__).resolve().parents[2] / 'examples').glob('pose_graph_*.py'))
SCAN_NS, REFERENCE_NS = 1_700_000_000_300_000_000, 1_700_000_000_000_000_000
DRAWS = 4000
# of the mean of so many values of chi squared with 6 degrees of freedom
SPREAD = np.sqrt(2 * 6 / DRAWS)


def from_docs(name):
    """Return the function of a name out of the examples that the page shows."""
    path, = (path for path in EXAMPLES if f'def {name}(' in path.read_text())
    return runpy.run_path(str(path))[name]


def bag_type(name):
    return STORE.types[name]


def edge_of(T, covariance):
    return odometry_of(bag_type, T, SCAN_NS, f'lidar@{REFERENCE_NS}', f'lidar@{SCAN_NS}',
                       covariance)


@pytest.fixture(scope='module')
def measured():
    """Return a step, its covariance and true steps drawn from it: all axes differ and mix."""
    rng = np.random.default_rng(0)
    T = se3.compose(Rotation.from_rotvec([0.4, -0.7, 2.0]).as_matrix(), np.array([7.0, -3, 1]))
    root = np.diag([0.3, 0.05, 0.1, 0.002, 0.01, 0.004]) @ (
        np.eye(6) + 0.4 * rng.normal(size=(6, 6)))
    noise = rng.normal(size=(DRAWS, 6)) @ root.T
    drawn = [se3.compose(Rotation.from_rotvec(xi[3:]).as_matrix() @ T[:3, :3], T[:3, 3] + xi[:3])
             for xi in noise]
    return T, root @ root.T, drawn


def test_gtsam_charges_what_the_covariance_says(measured):
    gtsam = pytest.importorskip('gtsam')
    T, covariance, drawn = measured
    graph = gtsam.NonlinearFactorGraph()
    from_docs('add_edge')(graph, edge_of(T, covariance))
    assert list(graph.at(0).keys()) == [REFERENCE_NS, SCAN_NS]
    values = gtsam.Values()
    values.insert(REFERENCE_NS, gtsam.Pose3())
    values.insert(SCAN_NS, gtsam.Pose3())
    charged = []
    for true in drawn:
        values.update(SCAN_NS, gtsam.Pose3(true))
        charged.append(2 * graph.error(values))
    assert np.mean(charged) == pytest.approx(6, abs=5 * SPREAD)


def test_g2o_charges_what_the_covariance_says(measured, tmp_path):
    g2o = pytest.importorskip('g2opy')
    T, covariance, drawn = measured
    line = from_docs('edge_line')(edge_of(T, covariance), {REFERENCE_NS: 0, SCAN_NS: 1})
    identity = ' 0 0 0 0 0 0 1'
    (tmp_path / 'graph.g2o').write_text(
        f'VERTEX_SE3:QUAT 0{identity}\nVERTEX_SE3:QUAT 1{identity}\nFIX 0\n{line}\n')
    optimizer = g2o.SparseOptimizer()
    assert optimizer.load(str(tmp_path / 'graph.g2o'))
    edge, = optimizer.edges()
    charged = []
    for true in drawn:
        optimizer.vertex(1).set_estimate(g2o.Isometry3d(true))
        edge.compute_error()
        charged.append(edge.chi2())
    assert np.mean(charged) == pytest.approx(6, abs=5 * SPREAD)


def test_a_drive_in_gtsam_ends_where_it_ended(street):
    """The edges of the tracker alone put every scan where the truth has it."""
    gtsam = pytest.importorskip('gtsam')
    tracker, graph, values = Tracker(), gtsam.NonlinearFactorGraph(), gtsam.Values()
    tracked = [tracker.track(SemanticScan(points, labels), (1 + i) * 10**9)
               for i, (points, labels, _) in enumerate(street)]
    add_edge = from_docs('add_edge')
    for scan in tracked:
        values.insert(scan.stamp_ns, gtsam.Pose3())
        if scan.T_reference_sensor is None:
            graph.add(gtsam.PriorFactorPose3(scan.stamp_ns, gtsam.Pose3(),
                                             gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
        else:
            add_edge(graph, relative_pose(bag_type, scan, 'lidar'))
    solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    marginals = gtsam.Marginals(graph, solved)
    first = street[0][2]
    for scan, (*_, true) in zip(tracked, street, strict=True):
        found = solved.atPose3(scan.stamp_ns).matrix()
        error = np.linalg.inv(first) @ true @ np.linalg.inv(found)
        assert np.linalg.norm(error[:3, 3]) < 0.15
        assert (np.linalg.eigvalsh(marginals.marginalCovariance(scan.stamp_ns)) > 0).all()
