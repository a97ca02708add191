"""Each example does what it says, on the built-in world."""
import importlib.util
from pathlib import Path
import subprocess
import sys

from conftest import errors
from conftest import relative
import numpy as np
import pytest

from sgor_ros.world import Lidar
from sgor_ros.world import loop_trajectory
from sgor_ros.world import simulate
from sgor_ros.world import street_scene

EXAMPLES = Path(__file__).resolve().parents[2] / 'examples'
TESTED = {'bag', 'label_convention', 'loops', 'maps', 'own_features', 'own_labels',
          'pose_graph_g2o', 'pose_graph_gtsam', 'register_two_scans'}


def example(name):
    """Load an example as a module."""
    spec = importlib.util.spec_from_file_location(f'example_{name}', EXAMPLES / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='module')
def street_poses():
    """Return where the scans of the examples were really taken."""
    return {speed: loop_trajectory(street_scene(0), 5, speed) for speed in (40.0, 60.0, 6.0)}


def test_all_examples_are_tested():
    assert {path.stem for path in EXAMPLES.glob('*.py')} == TESTED


@pytest.mark.parametrize(('name', 'speed', 'last'), [
    ('register_two_scans', 60.0, 2), ('own_labels', 60.0, 1), ('own_features', 40.0, 1),
    ('label_convention', 60.0, 1)])
def test_two_scans_are_registered(name, speed, last, street_poses, capsys):
    result = example(name).main()
    assert result.success
    assert not result.warnings, capsys.readouterr().out
    poses = street_poses[speed]
    metres, degrees = errors(result.T_target_source, relative(poses[0], poses[last]))
    assert metres < 0.1
    assert degrees < 0.3


def test_own_features_are_what_is_matched():
    module = example('own_features')
    _, points, labels, _ = next(simulate(1, seed=0))
    features = module.prepared(points, labels).features
    assert features.descriptors.shape[1] == 4 * len(module.RADII_M)


def test_the_table_of_five_classes_is_what_reads_the_labels():
    module = example('label_convention')
    _, _, raw, _ = next(simulate(1, seed=0))
    assert set(np.unique(module.ours(raw))) == {0, 1, 2, 3, 4, 5}


def test_a_bag_is_tracked(street_poses):
    first, *_, last = street_poses[6.0]
    tracked = example('bag').main([])
    assert len(tracked) == 5
    metres, _ = errors(tracked[-1].T_odom_sensor, relative(first, last))
    assert metres < 0.1


def test_the_graph_ends_where_the_drive_did(street_poses):
    pytest.importorskip('gtsam')
    solved = example('pose_graph_gtsam').main()
    last = solved.atPose3(max(solved.keys())).matrix()
    metres, _ = errors(last, relative(street_poses[6.0][0], street_poses[6.0][3]))
    assert metres < 0.1


def test_g2o_reads_what_is_written(tmp_path):
    g2o = pytest.importorskip('g2opy')
    (tmp_path / 'graph.g2o').write_text(example('pose_graph_g2o').main())
    optimizer = g2o.SparseOptimizer()
    assert optimizer.load(str(tmp_path / 'graph.g2o'))
    assert len(optimizer.vertices()) == 4
    assert len(optimizer.edges()) == 3
    # the vertices are where the edges put them
    for edge in optimizer.edges():
        edge.compute_error()
        assert edge.chi2() < 1


def test_an_example_runs_as_a_script():
    done = subprocess.run([sys.executable, EXAMPLES / 'bag.py'], capture_output=True, text=True,
                          check=True)
    assert len(done.stdout.splitlines()) == 5


def test_loops_are_closed_on_the_way_back(capsys):
    pytest.importorskip('gtsam')
    mapper = example('loops').main()
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == len(mapper.graph.loops) + 1 > 6
    # turned round in the other lane, 2.6 m to the left of where it began
    np.testing.assert_allclose(mapper.trajectory().T_map_sensor[-1, :3, 3], [0, 2.6, 0], atol=0.1)


def test_a_map_stays_and_is_gone_on_in(tmp_path, capsys):
    pytest.importorskip('gtsam')
    known = example('maps').main(tmp_path)
    printed = capsys.readouterr().out.splitlines()
    poses = [pose for *_, pose in simulate(16, lidar=Lidar(beams=32, columns=900), speed=25.0)]
    found, *ways, merged = printed
    assert 'registered' in found
    assert len(ways) == len(poses) - 5
    true = relative(poses[0], poses[-1])[:3, 3]
    np.testing.assert_allclose(np.array(ways[-1].split('[')[1].strip(']').split(), float), true,
                               atol=0.15)
    assert known.sessions == (0, 1)
    assert '2 sessions' in merged
