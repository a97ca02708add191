"""`--visualize`: what is written for rerun can be read back, and is what happened."""
import json
import os
import socket
import subprocess
import sys
import tracemalloc

from conftest import relative
import numpy as np
import pytest

from sgor_ros import SemanticScan
from sgor_ros import SgorConfig
from sgor_ros import TrackedScan
from sgor_ros.commands.register import main as register
from sgor_ros.commands.replay import main as replay
from sgor_ros.io.trajectories import read_kitti

rerun = pytest.importorskip('rerun', reason='the extra visualize is not installed')
RrdReader = pytest.importorskip('rerun.chunk').RrdReader

from sgor_ros.visualize import track_view  # noqa: E402
from sgor_ros.visualize import viewer_program  # noqa: E402
from sgor_ros.visualize.clouds import Map  # noqa: E402
from sgor_ros.visualize.clouds import Shown  # noqa: E402
from sgor_ros.visualize.recording import SHOWN_INLIERS  # noqa: E402


def entities(path):
    """Return the entities of a recording: of each component the values, in order of the scans."""
    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        order = (np.argsort(batch.column('scan').to_numpy(zero_copy_only=False))
                 if 'scan' in batch.schema.names else range(batch.num_rows))
        values = found.setdefault(chunk.entity_path, {})
        for name in batch.schema.names:
            column = batch.column(name)
            if not hasattr(column, 'flatten') or 'list' not in str(column.type):
                continue    # a timeline, or the number of a row
            values.setdefault(name, []).extend(column[int(i)].as_py() for i in order)
    return found


def component(values, ending):
    """Return the rows of the one component of an entity whose name ends so."""
    name, = (name for name in values if name.endswith(ending))
    return [np.array(row) for row in values[name] if row is not None]


@pytest.fixture(scope='module')
def replayed(street_bag, tmp_path_factory):
    """Return a replay of the street: its recording, and the folder of its results."""
    folder = tmp_path_factory.mktemp('look')
    assert replay([str(street_bag), '--output', str(folder / 'out'), '--keyframe-distance', '2',
                   '--no-predict-first', '--visualize', str(folder / 'look.rrd')]) == 0
    return entities(folder / 'look.rrd'), folder / 'out'


def test_all_of_a_drive_is_there(replayed):
    found, _ = replayed
    below = {'/world/track_1/map/00000', '/world/track_1/trajectory/00000',
             '/world/track_1/keyframes/00000', '/world/sensor', '/world/sensor/ground',
             '/pair/keyframe', '/pair/scan', '/pair/matches/inliers', '/pair/matches/rejected',
             '/pair/ground', '/plots/confidence/confidence', '/plots/confidence/threshold',
             '/plots/matches/inliers', '/plots/time/scan', '/state', '/about'}
    assert below <= found.keys()
    maps = [path for path in found if path.startswith('/world/track_1/map/')]
    assert len(maps) == 2, 'a second keyframe follows after 2 m'


def test_the_sensor_moves_as_the_track_says(replayed):
    found, out = replayed
    poses = read_kitti(out / 'trajectory_kitti.txt')
    places = component(found['/world/sensor'], 'translation')
    assert len(places) == len(poses)
    np.testing.assert_allclose(np.array(places)[:, 0], poses[:, :3, 3], atol=1e-4)
    line = component(found['/world/track_1/trajectory/00000'], ':strips')[-1]
    np.testing.assert_allclose(line[0], poses[:, :3, 3], atol=1e-4)


def test_inliers_stand_upright_between_the_clouds(replayed):
    found, _ = replayed
    inliers = component(found['/pair/matches/inliers'], ':strips')
    rejected = component(found['/pair/matches/rejected'], ':strips')
    assert len(inliers) == len(rejected) == 3
    for green, red in zip(inliers, rejected, strict=True):
        assert 10 < len(green) <= SHOWN_INLIERS
        slant = [np.linalg.norm(lines[:, 0, :2] - lines[:, 1, :2], axis=1) for lines in (green,
                                                                                        red)]
        assert slant[0].max() < 1.0 < slant[1].max()
        height = green[:, 0, 2] - green[:, 1, 2]
        assert height.std() < 0.3 < height.mean()


def test_confidence_is_that_of_the_registrations(replayed):
    found, out = replayed
    confidence = np.array(component(found['/plots/confidence/confidence'], ':scalars')).ravel()
    assert len(confidence) == 3
    assert (confidence > SgorConfig().min_confidence).all()
    assert (confidence <= 1).all()
    inliers = np.array(component(found['/plots/matches/inliers'], ':scalars')).ravel()
    every = np.array(component(found['/plots/matches/all'], ':scalars')).ravel()
    assert (inliers < every).all()
    seconds = json.loads((out / 'summary.json').read_text())['timings_ms']['total']
    shown = np.median(np.array(component(found['/plots/time/scan'], ':scalars')))
    assert 0 < shown < 1.5 * seconds['p95']


def test_the_map_has_classes_and_what_moves_is_not_on_it(street, replayed):
    found, _ = replayed
    points = component(found['/world/track_1/map/00000'], ':positions')[0]
    classes = component(found['/world/track_1/map/00000'], ':class_ids')[0]
    assert len(points) == len(classes) > 1000
    assert {9, 13, 15} <= set(classes.tolist()), 'road, buildings, vegetation'
    assert not set(classes.tolist()) & {6, 7, 8, 22}
    names = json.dumps(found['/'], default=str)
    assert 'building' in names


@pytest.mark.parametrize('same', [True, False])
def test_a_registration(street, tmp_path, same):
    rng = np.random.default_rng(0)
    other = street[3][0] if same else rng.uniform(-30, 30, (20000, 3))
    for name, points, labels in (('source', other, street[3][1] if same else None),
                                 ('target', *street[0][:2])):
        arrays = {'points': points} if labels is None else {'points': points, 'labels': labels}
        np.savez(tmp_path / f'{name}.npz', **arrays)
    code = register([str(tmp_path / 'source.npz'), str(tmp_path / 'target.npz'),
                     '--visualize', str(tmp_path / 'pair.rrd')])
    assert code == (0 if same else 1)
    found = entities(tmp_path / 'pair.rrd')
    assert {'/as_they_came/source', '/as_they_came/lines/inliers', '/matches/lines/rejected',
            '/aligned/source', '/aligned/target', '/result', '/about'} <= found.keys()
    before, after = (component(found[f'/{view}/source'], ':positions')[0]
                     for view in ('as_they_came', 'aligned'))
    if same:
        truth = relative(street[0][2], street[3][2])
        expected = before @ truth[:3, :3].T + truth[:3, 3]
        assert np.abs(after - expected).max() < 0.3
    else:
        np.testing.assert_allclose(after, before, atol=1e-4)


def test_the_map_shows_a_voxel_once_and_forgets_the_oldest():
    rng = np.random.default_rng(0)
    known = Map(0.5, most=3000)
    cloud = Shown(rng.uniform(-10, 10, (1000, 3)), np.full(1000, 9, np.uint8))
    shown, gone = {}, []
    for step in range(20):
        T = np.eye(4)
        T[0, 3] = 15.0 * step
        part, new, forgotten = known.add(cloud, T)
        shown[part] = new
        gone += forgotten
        assert known.add(cloud, T)[1].points.size == 0, 'nothing is new at the same place'
        assert len(known) <= 3000
    assert gone == sorted(set(gone))
    left = [new.points for part, new in shown.items() if part not in gone]
    assert sum(map(len, left)) == len(known)
    assert np.vstack(left)[:, 0].max() > 290, 'the newest stays'


def test_a_long_drive_needs_no_more_memory(tmp_path):
    rng = np.random.default_rng(0)
    scan = SemanticScan(rng.uniform(-20, 20, (3000, 3)))

    def tracked(index):
        return TrackedScan(index, True, '', np.eye(4), None, None, None, None, True, False, (),
                           {'matching': 0.1})

    with track_view(tmp_path / 'long.rrd', SgorConfig()) as look:
        tracemalloc.start()
        try:
            sizes = []
            for index in range(400):
                look.show(scan, tracked(index))
                if index in (199, 399):
                    sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert sizes[1] - sizes[0] < 500_000


def test_a_new_track_goes_on_where_the_old_one_ended(tmp_path):
    scan = SemanticScan(np.random.default_rng(0).uniform(-20, 20, (3000, 3)))
    T = np.eye(4)
    T[0, 3] = 7.0
    with track_view(tmp_path / 'two.rrd', SgorConfig()) as look:
        for index, (track, pose) in enumerate([(1, np.eye(4)), (1, T), (2, np.eye(4)), (2, T)]):
            look.show(scan, TrackedScan(index, True, '', pose, None, None, None, None, True, False,
                                        (), {}, track_id=track))
    found = entities(tmp_path / 'two.rrd')
    x = np.array(component(found['/world/sensor'], 'translation'))[:, 0, 0]
    np.testing.assert_allclose(x, [0, 7, 7, 14])
    np.testing.assert_allclose(component(found['/world/track_2'], 'translation')[0][0], [7, 0, 0])


@pytest.mark.parametrize(('target', 'says'), [
    ('look.png', 'expected a name ending in .rrd'), ('no/look.rrd', 'no folder ')])
def test_what_cannot_be_written_is_refused_before_the_work(street_bag, tmp_path, capsys, target,
                                                           says):
    for command in (replay, register):
        paths = [str(street_bag), '--output', str(tmp_path / 'out')]
        if command is register:
            paths = ['no.bin', 'no.bin']
        assert command([*paths, '--visualize', str(tmp_path / target)]) == 2
        assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_without_a_display_it_is_told_before_the_work(street_bag, tmp_path, monkeypatch, capsys):
    for name in ('DISPLAY', 'WAYLAND_DISPLAY'):
        monkeypatch.delenv(name, raising=False)
    assert replay([str(street_bag), '--output', str(tmp_path / 'out'), '--visualize']) == 2
    assert 'no display here' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_viewer_of_the_interpreter_is_found_off_path(monkeypatch):
    monkeypatch.setenv('PATH', '/nowhere')
    assert os.access(viewer_program(), os.X_OK)


def test_results_are_written_though_the_viewer_dies(street_bag, tmp_path):
    """A display that is named and not there: the real viewer starts, and ends."""
    program = [sys.executable, '-m', 'sgor_ros.commands.replay', str(street_bag), '--output',
               str(tmp_path / 'out'), '--visualize']
    done = subprocess.run(program, env={**os.environ, 'DISPLAY': ':987'}, capture_output=True,
                          text=True, timeout=300)
    if done.returncode == 2:    # a viewer that ends at once is told before the work
        assert 'the viewer does not start' in done.stderr
        return
    assert done.returncode == 0, done.stderr
    assert 'nothing more is shown' in done.stderr
    assert json.loads((tmp_path / 'out/summary.json').read_text())['successes'] == 4


def test_a_viewer_that_takes_nothing_ends_the_view_and_not_the_work(monkeypatch, caplog):
    """Its port is open and nobody answers, as of one that was stopped."""
    monkeypatch.setenv('DISPLAY', ':987')
    with socket.socket() as deaf:
        deaf.bind(('127.0.0.1', 0))
        deaf.listen(8)
        port = deaf.getsockname()[1]
        monkeypatch.setattr(rerun, 'spawn', lambda recording, **_: recording.connect_grpc(
            f'rerun+http://127.0.0.1:{port}/proxy'))
        monkeypatch.setattr('sgor_ros.visualize.recording.PATIENCE_S', 1.0)
        scan = SemanticScan(np.random.default_rng(0).uniform(-20, 20, (3000, 3)))
        with track_view('', SgorConfig()) as look:
            for index in range(5):
                look.show(scan, TrackedScan(index, True, '', np.eye(4), None, None, None, None,
                                            True, False, (), {}))
    assert look.broken
    assert caplog.text.count('nothing more is shown') == 1


def test_without_rerun_it_says_what_to_install(street_bag, monkeypatch, capsys):
    monkeypatch.setattr('sgor_ros.visualize.find_spec', lambda name: None)
    assert replay([str(street_bag), '--visualize', 'look.rrd']) == 2
    assert 'pip install rerun-sdk' in capsys.readouterr().err
