"""The benchmark: its pairs and their truth, its figures, and each of its commands."""
import csv
import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sgor_ros.commands.benchmark import main
from sgor_ros.core.config import SgorConfig
from sgor_ros.evaluation import solver
from sgor_ros.evaluation.job import turned
from sgor_ros.evaluation.memory import peak_memory_mb
from sgor_ros.evaluation.methods import Answer
from sgor_ros.evaluation.methods import Method
from sgor_ros.evaluation.methods import sgor
from sgor_ros.evaluation.methods.sgor import random_labels
from sgor_ros.evaluation.metrics.pose_error import NEES_BOUND
from sgor_ros.evaluation.metrics.registration_recall import at_threshold
from sgor_ros.evaluation.metrics.row import Row
from sgor_ros.evaluation.protocols import pairs as pairing
from sgor_ros.evaluation.protocols.ablation import PAPER_ROWS
from sgor_ros.evaluation.protocols.pairs import Pair
from sgor_ros.evaluation.report import tables
from sgor_ros.evaluation.runner import run_pairs
from sgor_ros.io.datasets import Drive
from sgor_ros.io.datasets import DriveScan
from sgor_ros.io.datasets import open_drives
from sgor_ros.io.trajectories import write_kitti

# camera axes: x right, y down, z ahead; and a lever arm
T_CAMERA_SENSOR = np.array([[0., -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])


def write_drive(folder, street):
    """Write scans as SemanticKITTI has them, with poses of a camera."""
    for name in ('velodyne', 'labels'):
        (folder / name).mkdir(parents=True)
    for i, (points, labels, _) in enumerate(street):
        np.column_stack((points, np.ones(len(points)))).astype(np.float32).tofile(
            folder / f'velodyne/{i:06d}.bin')
        labels.astype(np.uint32).tofile(folder / f'labels/{i:06d}.label')
    first = np.linalg.inv(street[0][2])
    write_kitti(folder / 'poses.txt', [T_CAMERA_SENSOR @ first @ T @ np.linalg.inv(T_CAMERA_SENSOR)
                                       for _, _, T in street])
    numbers = ' '.join(map(str, T_CAMERA_SENSOR[:3].ravel()))
    (folder / 'calib.txt').write_text(f'P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: {numbers}\n')


@pytest.fixture(scope='module')
def sequences_folder(street, tmp_path_factory):
    """Return a folder of two SemanticKITTI sequences."""
    root = tmp_path_factory.mktemp('kitti')
    write_drive(root / 'sequences/00', street)
    write_drive(root / 'sequences/01', street[:2])
    return root


def rows_of(folder):
    with open(folder / 'rows.csv') as file:
        return list(csv.DictReader(file))


def row(score=0.9, right=True, within=True, valid=True, distance=5.0, **changes):
    values = {'method': 'm', 'data_set': 'd', 'source': 's', 'target': 't', 'right': right,
              'distance_m': distance, 'rotation_error_deg': 0.1, 'translation_error_m': 0.02,
              'within': within, 'valid': valid, 'score': score, 'seconds': 0.1,
              'seconds_one_new': 0.05}
    return Row(**{**values, **changes})


def median_distance(pair, T):
    moved = pair.source.read().points[::20] @ T[:3, :3].T + T[:3, 3]
    return np.median(cKDTree(pair.target.read().points).query(moved)[0])


def test_drives_of_a_user_have_poses_of_the_sensor(sequences_folder, street):
    drives = open_drives(sequences_folder)
    assert [drive.name for drive in drives] == ['sequences/00', 'sequences/01']
    assert [len(drive.scans) for drive in drives] == [4, 2]
    truth = np.linalg.inv(street[0][2]) @ street[3][2]
    assert np.allclose(drives[0].T_world_sensor[3], truth, atol=1e-6)
    scan = drives[0].scans[2].read()
    assert np.array_equal(scan.points, street[2][0])
    assert np.array_equal(scan.labels, street[2][1])


def test_near_pairs_are_those_within_reach(sequences_folder, street):
    drive = open_drives(sequences_folder / 'sequences')[0]
    pairs = pairing.near_pairs([drive], 2.0)    # scans are 1.5 m apart
    assert [(p.source.name[-1], p.target.name[-1]) for p in pairs] == [
        ('1', '0'), ('2', '1'), ('3', '2')]
    truth = np.linalg.inv(street[1][2]) @ street[2][2]
    assert np.allclose(pairs[1].T_target_source, truth, atol=1e-6)
    assert len(pairing.near_pairs([drive], 36.0)) == 6


def test_a_drive_may_be_the_folder_itself(sequences_folder):
    drive, = open_drives(sequences_folder / 'sequences/01')
    assert drive.name == '01'


def test_real_drives_and_pairs_lie_on_each_other(data_folder):
    drives = {drive.name: drive for drive in open_drives(data_folder)}
    assert {'kitti/00', 'kitti/05', 'kitti/08', 'nuscenes'} == set(drives)
    conventions = {name: {f.label_convention for f in drive.scans}
                   for name, drive in drives.items()}
    assert conventions['nuscenes'] == {'nuscenes'}
    assert conventions['kitti/08'] == {'semantickitti'}
    assert conventions['kitti/00'] == {'semantickitti', 'semantickitti_train'}
    assert not drives['nuscenes'].heights_known
    near = pairing.near_pairs([drives['kitti/08']], 36.0)
    listed = pairing.listed_pairs(data_folder, 36.0)
    assert len(near) == 45
    entries = [entry for entry in json.loads((data_folder / 'pairs.json').read_text())
               if 'kitti/08' not in entry['source']]
    assert len(listed) == sum(len(e['source_labels']) * len(e['target_labels']) for e in entries)
    for pair in (near[-1], listed[0], listed[-1]):
        back = np.linalg.inv(pair.T_target_source)
        assert median_distance(pair, pair.T_target_source) < 0.4
        assert median_distance(pair, pair.T_target_source) < 0.8 * median_distance(pair, back)


def test_choose_takes_evenly_from_the_data_sets():
    pairs = [Pair(frame(name), frame(name), np.eye(4)) for name in 'aaaaaaaabbb']
    chosen = pairing.choose(pairs, 6, seed=0)
    assert [pair.data_set for pair in chosen] == ['a', 'b'] * 3
    assert len(set(map(id, chosen))) == 6
    assert chosen != pairing.choose(pairs, 6, seed=1)
    assert len(pairing.choose(pairs, 100, seed=0)) == 11


def test_choose_takes_evenly_from_near_and_far():
    pairs = [Pair(frame('a'), frame('a'), apart(x)) for x in (1, 2, 3, 4, 5, 6, 7, 8, 25, 31)]
    assert sorted(p.distance_m // 10 for p in pairing.choose(pairs, 4, seed=0)) == [0, 0, 2, 3]


def apart(x):
    T = np.eye(4)
    T[0, 3] = x
    return T


def frame(data_set, name='f'):
    return DriveScan(name, data_set, 'semantickitti', lambda: None)


def test_wrong_pairs_are_of_different_places():
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = (0, 50, 99, 120)
    long = Drive('long', [frame('k', f'long{i}') for i in range(4)], poses)
    short = Drive('short', [frame('n', f'short{i}') for i in range(3)], None)
    pairs = pairing.wrong_pairs([long, short], 100, seed=0)
    assert not any(pair.right for pair in pairs)
    names = {(pair.source.name, pair.target.name) for pair in pairs}
    across = {(f'long{i}', f'short{j}') for i in range(4) for j in range(3)}
    assert names == across | {('long3', 'long0')}
    assert len(pairing.wrong_pairs([long, short], 5, seed=0)) == 5


def test_the_truth_of_a_turned_pair_maps_the_same_points(sequences_folder):
    pair = pairing.near_pairs(open_drives(sequences_folder), 36.0)[2]
    sample, truth = turned(pair, seed=3)
    scan = pair.source.read().points.astype(float)
    before = scan @ pair.T_target_source[:3, :3].T + pair.T_target_source[:3, 3]
    after = sample.source.points.astype(float) @ truth[:3, :3].T + truth[:3, 3]
    assert np.allclose(before, after, atol=1e-3)
    assert np.linalg.norm(scan - sample.source.points, axis=1).max() > 5
    again, _ = turned(pair, seed=3)
    assert np.array_equal(again.source.points, sample.source.points)


def test_random_labels_replace_the_share_that_was_asked_for():
    labels = np.repeat([40, 50, 70, 80], 5000)
    spoiled = random_labels(labels, 0.5, np.random.default_rng(0))
    # a quarter of the random ones are right by chance
    assert np.mean(spoiled != labels) == pytest.approx(0.375, abs=0.02)
    assert set(spoiled) == {40, 50, 70, 80}


@pytest.mark.parametrize('heights_known', [True, False])
def test_heights_count_only_where_they_are_known(sequences_folder, heights_known):
    pair = pairing.near_pairs(open_drives(sequences_folder), 36.0)[0]
    pair = Pair(pair.source, pair.target, pair.T_target_source, heights_known=heights_known)
    too_high = turned(pair, seed=0)[1]
    too_high[2, 3] += 1.0
    method = Method('m', lambda sample: Answer(too_high, score=1.0))
    found, = run_pairs([pair], [method], seed=0)
    assert found.success is not heights_known
    assert found.false_accept is heights_known
    assert found.translation_error_m == pytest.approx(1.0 if heights_known else 0.0, abs=1e-9)
    assert found.rotation_error_deg < 1e-4


def test_recall_counts_neither_refused_nor_wrong_answers():
    rows = [row(), row(valid=False), row(within=False), row()]
    assert tables.recall(rows) == '50.0 % (2/4)'
    rows[0] = row(rotation_error_deg=0.3, translation_error_m=0.04)
    assert tables.errors(rows) == ('0.20 / 0.20', '3.0 / 3.0')
    assert tables.recall(tables.in_band([row(distance=10.0), row(distance=9.9)], 0, 10)
                         ) == '100.0 % (1/1)'


def test_times_of_few_runs_are_marked():
    assert tables.times([0.1, 0.2, 0.3]) == '200 / 290 (only 3)'
    assert tables.times(np.arange(1, 22) / 1000) == '11 / 20'
    assert tables.times([float('nan')]) == '-'


def test_the_table_tells_false_accepts_apart():
    rows = [row(), row(within=False), row(right=False, within=False),
            row(right=False, within=False, valid=False)]
    line = tables.pairs_table(rows, ['m'], {'m': 321.4}).splitlines()[-1]
    cells = [cell.strip() for cell in line.strip('|').split('|')]
    assert cells[0] == 'm'
    assert cells[1] == '50.0 % (1/2)'
    assert cells[-3:] == ['321', '1 of 2', '1 of 2']


def test_thresholds_refuse_below_and_accept_from_there_on():
    rows = [row(0.5), row(0.9), row(0.7, distance=25.0), row(0.7, within=False),
            row(0.8, right=False, within=False), row(0.2, right=False, within=False)]
    refused, near, bad, wrong = at_threshold(rows, 0.8)
    assert refused.tolist() == [True, False, True]
    assert near.tolist() == [True, False]
    assert bad.tolist() == [False]
    assert wrong.tolist() == [True, False]


def test_sgor_refused_for_few_inliers_passes_no_threshold(sequences_folder):
    pair = pairing.near_pairs(open_drives(sequences_folder), 36.0)[0]
    sample, _ = turned(pair, seed=0)
    answer = sgor('m', SgorConfig(min_inliers=10000)).on_scans(sample)
    assert not answer.valid
    assert answer.score == 0.0
    assert sgor('m', SgorConfig()).on_scans(sample).score > 0.9


def test_made_up_matches_hold_the_share_of_right_ones():
    pair = solver.made_up(2000, 0.1, seed=0)
    T, matches = pair.T_target_source, pair.matches
    residuals = np.linalg.norm(matches.source @ T[:3, :3].T + T[:3, 3] - matches.target, axis=1)
    assert np.sum(residuals < 0.6) == pytest.approx(200, abs=3)


def test_real_matches_are_read_with_their_truth(data_folder):
    sets = {pair.name: pair.matches for pair in solver.real_matches(data_folder)}
    assert set(sets) == {'kitti_000', 'kitti_010', 'kitti_020'}
    assert all(m.source.shape == m.target.shape and len(m.source) > 4000 for m in sets.values())


def test_pairs_command(sequences_folder, tmp_path, capsys):
    code = main(['pairs', '--data', str(sequences_folder), '--methods', 'sgor', '--limit', '3',
                 '--wrong', '2', '--label-noise', '0.5', '--no-labels', '--output',
                 str(tmp_path / 'out')])
    assert code == 0
    rows = rows_of(tmp_path / 'out')
    assert len(rows) == 3 * (3 + 2)
    right = [r for r in rows if r['right'] == 'True']
    assert {r['method'] for r in right} == {'SGOR', 'SGOR, 50% of labels random',
                                           'SGOR, no labels'}
    assert all(r['within'] == r['valid'] == 'True' for r in right)
    assert all(float(r['translation_error_m']) < 0.1 for r in right)
    assert all(float(r['seconds_one_new']) < float(r['seconds']) for r in rows)
    table = (tmp_path / 'out/table.md').read_text()
    assert table.strip() in capsys.readouterr().out
    assert '| SGOR | 100.0 % (3/3) |' in table
    setup = json.loads((tmp_path / 'out/run.json').read_text())
    assert setup['options']['seed'] == 0
    assert setup['right_pairs'] == 3
    assert setup['environment']['cores'] >= 1
    assert setup['config']['threads'] == 2
    assert setup['revision']
    assert (tmp_path / 'out/plot.png').stat().st_size > 10_000


def test_peak_memory_is_of_each_method_alone(sequences_folder, tmp_path):
    pair = pairing.near_pairs(open_drives(sequences_folder), 36.0)[0]
    sample, _ = turned(pair, seed=0)
    ballast = np.ones(60_000_000)    # 480 MB here, none of them there
    memory = peak_memory_mb([Method('big', _allocate), Method('small', _answer)], sample)
    assert 30 < memory[''] < 450
    # both have loaded this file, and all that it imports
    assert memory['big'] - memory['small'] == pytest.approx(200, abs=40)
    assert memory[''] <= memory['small']
    assert ballast.any()


def _answer(sample):
    return Answer(None)


def _allocate(sample):
    return Answer(None, score=float(np.ones(25_000_000).sum()))    # 200 MB


def test_wrong_command(sequences_folder, tmp_path):
    out = tmp_path / 'out'
    assert main(['wrong', '--data', str(sequences_folder), '--limit', '2', '--count', '3',
                 '--output', str(out)]) == 0
    rows = rows_of(out)
    for method in ('SGOR', 'SGOR, no labels'):
        own = [r['right'] for r in rows if r['method'] == method]
        assert (own.count('True'), own.count('False')) == (2, 3)
    # the built-in world stays out where data is given
    assert {r['data_set'] for r in rows} == {'kitti'}
    assert '(default)' in (out / 'table.md').read_text()
    assert (out / 'confidence.png').is_file()


def test_ablation_command(sequences_folder, tmp_path):
    out = tmp_path / 'out'
    assert main(['ablation', '--data', str(sequences_folder), '--pairs', '1', '--output',
                 str(out)]) == 0
    rows = rows_of(out)
    names = [r['method'] for r in rows]
    assert len(set(names)) == len(names)
    # all that the default does and the paper does not
    default, paper = SgorConfig(), SgorConfig.paper()
    beyond = {item.name for item in SgorConfig.settings()
              if getattr(default, item.name) != getattr(paper, item.name)}
    assert {name.split('=')[0] for name in names if '=' in name} == beyond
    assert sum(name.startswith('paper, row ') for name in names) == 5    # its own ablations
    table = (out / 'table.md').read_text()
    for row in PAPER_ROWS:
        assert f'| {row.number}) {row.name} | {row.recall:.2f} % |' in table
    default = next(r for r in rows if r['method'] == 'default')
    assert default['within'] == 'True'
    # without the local refinement the answer is another
    coarse = next(r for r in rows if r['method'] == 'local_refinement=False')
    assert coarse['translation_error_m'] != default['translation_error_m']


def test_sequence_command(sequences_folder, tmp_path):
    out = tmp_path / 'out'
    assert main(['sequence', '--data', str(sequences_folder), '--output', str(out)]) == 0
    rows = rows_of(out)
    for drive, scans in (('sequences/00', 4), ('sequences/01', 2)):
        for mode in ('consecutive', 'keyframe'):
            own = [r for r in rows if (r['drive'], r['method']) == (drive, f'SGOR, {mode}')]
            assert [int(r['scan']) for r in own] == list(range(scans))
            assert float(own[-1]['off_the_truth_m']) < 0.1
    assert 'small_gicp, scan to scan' in {r['method'] for r in rows}
    assert all(float(r['cpu_seconds']) > 0 for r in rows)
    # the third of a drive is the first that can be predicted
    for r in rows:
        assert (r['confirmed'] == 'True') <= (int(r['scan']) > 1)
    assert any(r['confirmed'] == 'True' for r in rows)
    # what the tracker claims of itself; the rivals claim nothing
    for r in rows:
        assert (r['state'] == '') is not r['method'].startswith('SGOR')
        if r['state'] == 'tracking':
            assert float(r['error_m']) == pytest.approx(float(r['off_the_truth_m']), abs=1e-6)
            assert 0.002 < float(r['claimed_m']) < 0.5
            assert float(r['pose_nees']) < NEES_BOUND


def test_sequence_command_through_places(tmp_path):
    out = tmp_path / 'out'
    assert main(['sequence', '--scans', '0', '--per-kind', '4', '--kinds', 'field', 'tunnel',
                 '--no-labels', '--seed', '2', '--output', str(out)]) == 0
    rows = rows_of(out)
    methods = {f'SGOR, {mode}{labels}' for mode in ('consecutive', 'keyframe')
               for labels in ('', ', no labels')}
    assert {(r['drive'], r['method']) for r in rows} == {
        (kind, method) for kind in ('field', 'tunnel') for method in methods}
    states = {kind: [r['state'] for r in rows if r['drive'] == kind and int(r['scan'])]
              for kind in ('field', 'tunnel')}
    assert set(states['field']) == {'tracking'}
    assert 'tracking' not in states['tunnel']
    table = (out / 'table.md').read_text()
    assert 'tunnel: SGOR, keyframe, no labels | 4 | 0%' in table


def test_solver_command(sequences_folder, tmp_path):
    """Made-up matches and those of scans, by all solvers; they find what is true."""
    out = tmp_path / 'out'
    assert main(['solver', '--counts', '400', '1000', '--inlier-share', '0.1', '--runs', '2',
                 '--dense-limit', '400', '--data', str(sequences_folder), '--pairs', '2',
                 '--fpfh-matches', '1500', '--output', str(out)]) == 0
    rows = rows_of(out)
    assert len({r['matches'] for r in rows}) == 3
    for r in rows:
        made_up = r['matches'] == 'made up'
        assert int(r['count']) in ((400, 1000) if made_up else (1500,))
        assert float(r['inlier_share']) == pytest.approx(0.1, abs=0.002) or not made_up
        assert 0 < float(r['consistent_share']) < 0.2
        assert 0 < float(r['cpu_seconds'])
        if r['solver'].startswith('SGOR'):
            assert float(r['translation_error_m']) < 0.3
    assert {r['solver'] for r in rows} >= {
        'SGOR', 'SGOR, one thread', "SGOR, paper's settings, one thread"}
    dense, sparse = (next(r for r in rows if r['solver'].startswith(name))
                     for name in ('dense numpy', 'SGOR, 20 groups'))
    assert float(dense['translation_error_m']) == pytest.approx(
        float(sparse['translation_error_m']), abs=1e-5)


@pytest.mark.parametrize(('arguments', 'message'), [
    (['pairs', '--data', 'nowhere'], 'nowhere: no such file or folder'),
    (['pairs', '--data', '{data}', '--methods', 'icp'], '--methods icp: not one of sgor, paper'),
    (['pairs', '--data', '{data}', '--max-distance', '0.1'], 'no pairs within 0.1 m'),
    (['wrong', '--data', '{data}/sequences/01'], 'no wrong pairs'),
    (['solver', '--data', 'nope'], 'nope: no such file or folder'),
    (['solver', '--output', '{data}'], 'exists already'),
])
def test_unusable_input_is_told_in_one_line(arguments, message, sequences_folder, capsys,
                                            tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = main([argument.format(data=sequences_folder) for argument in arguments])
    assert code == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith('error: ')
    assert message in error
    assert not list(tmp_path.glob('out/benchmark/*'))


def test_a_second_run_has_a_folder_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ('solver', 'solver_2'):
        assert main(['solver', '--counts', '400', '--runs', '1', '--dense-limit', '0']) == 0
        assert f'wrote out/benchmark/{name}' in capsys.readouterr().err
        assert {path.name for path in (tmp_path / 'out/benchmark' / name).iterdir()} == {
            'table.md', 'rows.csv', 'run.json', 'plot.png'}


@pytest.mark.parametrize(('break_it', 'message'), [
    (lambda d: (d / 'poses.txt').write_text('1 2 3\n'), 'expected 12 numbers a line'),
    (lambda d: (d / 'poses.txt').write_text('1 0 0 0 0 1 0 0 0 0 1 0\n'), 'poses.txt: 1 rows for'),
    (lambda d: (d / 'calib.txt').write_text('P0: 1\n'), 'no row Tr'),
    (lambda d: [scan.unlink() for scan in (d / 'velodyne').iterdir()], 'no .bin files'),
    (lambda d: (d / 'pairs.json').write_text('[{"source": 1}]'), 'expected source, target'),
])
def test_broken_drives_are_told_in_one_line(break_it, message, street, tmp_path, capsys):
    write_drive(tmp_path / 'drive', street[:2])
    break_it(tmp_path / 'drive')
    assert main(['pairs', '--data', str(tmp_path / 'drive'), '--methods', 'sgor']) == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.parametrize('arguments', [
    ['pairs', '--limit', '0'], ['pairs', '--label-noise', '1.5'], ['solver', '--counts', 'many'],
    []])
def test_wrong_usage_ends_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert 'usage' in capsys.readouterr().err
