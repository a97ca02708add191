"""Protocols, runs that resume, tables: by hand, on small drives, and on the shared data."""
from dataclasses import replace
import itertools
import multiprocessing
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import numpy as np
from PIL import Image
import pytest

from sgor_ros import InputError
from sgor_ros.core.common import se3
from sgor_ros.evaluation import front_end
from sgor_ros.evaluation.methods import Answer
from sgor_ros.evaluation.methods import Matches
from sgor_ros.evaluation.methods import Method
from sgor_ros.evaluation.metrics import row as table
from sgor_ros.evaluation.metrics.inliers import kept_scores
from sgor_ros.evaluation.metrics.registration_recall import EASY
from sgor_ros.evaluation.metrics.row import Row
from sgor_ros.evaluation.protocols import studies
from sgor_ros.evaluation.protocols.drives import posed
from sgor_ros.evaluation.protocols.drives import strided
from sgor_ros.evaluation.protocols.indoor import cloud_of_depth
from sgor_ros.evaluation.protocols.indoor import depth_frames
from sgor_ros.evaluation.protocols.indoor import threedmatch
from sgor_ros.evaluation.protocols.kitti import kitti_10m
from sgor_ros.evaluation.protocols.kitti import kitti_10m_list
from sgor_ros.evaluation.protocols.kitti import kitti_loops
from sgor_ros.evaluation.protocols.kitti import read_pair_list
from sgor_ros.evaluation.protocols.kitti import ten_metre_pairs
from sgor_ros.evaluation.protocols.match_files import given_matches
from sgor_ros.evaluation.protocols.pairs import drive_of
from sgor_ros.evaluation.protocols.truth import refined
from sgor_ros.evaluation.report.protocol_tables import latex
from sgor_ros.evaluation.report.protocol_tables import main_rows
from sgor_ros.evaluation.report.protocol_tables import whole
from sgor_ros.evaluation.runner import run
from sgor_ros.world import Lidar
from sgor_ros.world import simulate

DATA = Path(os.environ.get('SGOR_DATA', Path(__file__).resolve().parents[3] / 'shared/data'))
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason='no shared data')


@pytest.fixture(scope='module')
def drive():
    lidar = Lidar(beams=24, columns=500)
    return drive_of('street', (scan[1:] for scan in simulate(6, 0, lidar=lidar, speed=30.0)))


def centroid(matches):
    """Stand in for a method that is quick and the same everywhere: shift by the median."""
    shift = np.median(matches.target - matches.source, axis=0)
    return Answer(se3.compose(np.eye(3), shift), np.arange(0, len(matches.source), 2))


def tired(matches):
    """Give up on the third pair of a process, as a kill would."""
    tired.done += 1
    if tired.done > 2:
        raise KeyboardInterrupt
    return centroid(matches)


def slow(matches):
    time.sleep(0.3)
    return centroid(matches)


def text_of(rows):
    """Return what a run says, times left out."""
    return table.lines(replace(each, seconds=0.0) for each in rows)


def test_ten_metre_rule_by_hand():
    """3 m a scan: 9 m is the last before 10; then the next scan on; a stop passes scan by scan."""
    positions = np.zeros((12, 3))
    positions[:, 0] = 3.0 * np.arange(12)
    assert ten_metre_pairs(positions) == [(0, 3), (4, 7)]
    standing = np.vstack((np.zeros((150, 3)), positions))
    # from 0 on, 100 scans show nothing: on to 51, from which scan 150 + 4 is in sight
    assert ten_metre_pairs(standing)[0] == (55, 153)


@needs_data
def test_lists_and_rule_of_kitti():
    lists = DATA / 'pair_lists'
    rows = read_pair_list(lists / 'kitti_10m.txt')
    assert len(rows) == 556
    assert [sum(row[0] == s for row in rows) for s in (8, 9, 10)] == [307, 162, 87]
    # the list was made by the rule: each pair begins where the one before ends, or later
    for before, row in itertools.pairwise(rows):
        assert row[0] != before[0] or row[1] > before[3]
    found = kitti_10m_list(lists / 'kitti_10m.txt', lambda *_: None)
    assert (len(found.pairs), found.missing) == (0, 555)
    sizes = [len(read_pair_list(lists / f'kitti_loops_{band}.txt'))
             for band in ('0_10', '10_20', '20_30')]
    assert sizes == [914, 1151, 1260]


@needs_data
def test_listed_truth_maps_source_into_target():
    """Of the first row of the loops whose scans would be here, by the poses of the sequence."""
    path = DATA / 'pair_lists/kitti_loops_0_10.txt'
    for _, _, _, _, T in read_pair_list(path)[:50]:
        assert np.linalg.norm(T[:3, 3]) < 10.5
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1, abs=1e-3)


def test_a_list_that_is_none_is_refused(tmp_path):
    (tmp_path / 'list.txt').write_text('a b\n1 2 3\n')
    with pytest.raises(InputError, match='3 columns, expected 20'):
        read_pair_list(tmp_path / 'list.txt')


def test_listed_pairs_are_found_by_sequence_and_scan(tmp_path, drive):
    truth = ' '.join(map(str, np.eye(4).ravel()))
    path = tmp_path / 'kitti_loops_0_10.txt'
    path.write_text(f'header\n0 1 0 3 {truth}\n0 1 0 99 {truth}\n')
    found = kitti_loops([path], lambda s, i: drive.scans[i] if i < 6 else None)
    pair, = found.pairs
    assert (pair.name, pair.group, found.missing) == ('00 1 00 3', '0-10 m', 1)
    assert pair.source is drive.scans[1]
    assert pair.target is drive.scans[3]


def test_truth_of_made_pairs(drive):
    """The truth maps the source, and pairs are the ones that were asked for."""
    T = drive.T_world_sensor
    by_rule = kitti_10m([drive], [T[:, :3, 3]])
    assert [pair.name for pair in by_rule.pairs] == ['street 0 3', 'street 4 5'][
        :len(by_rule.pairs)]
    strides = strided([drive], [2])
    assert len(strides.pairs) == 4
    for protocol in (by_rule, strides, posed([drive], 7.0)):
        for pair in protocol.pairs:
            i, j = drive.scans.index(pair.source), drive.scans.index(pair.target)
            assert pair.T_target_source == pytest.approx(np.linalg.inv(T[j]) @ T[i])


def test_kept_scores_by_hand():
    """Four matches, two right; kept one of those and one other: a half of everything."""
    source = np.zeros((4, 3))
    target = np.array([[0.0, 0, 0], [0.5, 0, 0], [5, 0, 0], [9, 0, 0]])
    scores = kept_scores(source, target, [0, 2], np.eye(4), 0.6)
    assert (scores.precision, scores.recall, scores.f1) == (0.5, 0.5, 0.5)
    assert kept_scores(source, target, [], np.eye(4), 0.6).f1 == 0


def test_a_killed_run_goes_on_to_the_same_table(tmp_path, drive):
    protocol = strided([drive], [1, 2])
    whole_run = run(protocol, [Method('m', on_matches=centroid)], tmp_path / 'whole')
    tired.done = 0
    with pytest.raises(KeyboardInterrupt):
        run(protocol, [Method('m', on_matches=tired)], tmp_path / 'killed')
    # and the last line cut off
    path = tmp_path / 'killed/pairs.csv'
    path.write_text(path.read_text() + 'm,,street 4')
    resumed = run(protocol, [Method('m', on_matches=centroid)], tmp_path / 'killed')
    assert text_of(resumed) == text_of(whole_run)
    assert len(path.read_text().splitlines()) == 1 + len(protocol.pairs)
    # nothing is run again
    assert run(protocol, [Method('m', on_matches=None)], tmp_path / 'killed') == resumed


def test_processes_and_dask_give_the_same_table(tmp_path, drive):
    from distributed import LocalCluster
    protocol = strided([drive], [1])
    entries = [Method('m', on_matches=centroid)]
    one = run(protocol, entries, tmp_path / '1')
    assert text_of(run(protocol, entries, tmp_path / '2', processes=2)) == text_of(one)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        by_dask = run(protocol, entries, tmp_path / 'd', dask=cluster.scheduler_address)
    assert text_of(by_dask) == text_of(one)
    with pytest.raises(InputError, match='no scheduler there'):
        run(protocol, entries, tmp_path / 'e', dask='tcp://127.0.0.1:1')


def test_another_protocol_does_not_go_into_the_same_folder(tmp_path, drive):
    run(strided([drive], [1]), [Method('m', on_matches=centroid)], tmp_path)
    with pytest.raises(InputError, match='holds a run with another protocol'):
        run(posed([drive], 5.0), [Method('m', on_matches=centroid)], tmp_path)


def test_main_table_by_hand(drive):
    """Of two answers one is right: RR 50, means of RE and TE over that one, of IP over both."""
    def row(pair, te, precision):
        return Row(method='m', pair=pair, group='g', rotation_error_deg=1.0,
                   translation_error_m=te,
                   within=te < 0.6, precision=precision, recall=0.5, f1=0.4, matches=100,
                   right_share=0.1, seconds=0.02)
    protocol = strided([drive], [1])
    header, rows = main_rows([row('a', 0.1, 0.8), row('b', 3.0, 0.2)], protocol, EASY)
    assert dict(zip(header, rows[0], strict=True)) == {
        'method': 'm', 'pairs': '2', 'RR %': '50.00', 'RE deg': '1.00', 'TE cm': '10.00',
        'IP %': '50.00', 'IR %': '50.00', 'F1 %': '40.00', 'ms median': '20', 'ms p95': '20'}
    text = whole([row('a', 0.1, 0.8), row('b', 3.0, 0.2)], protocol)
    assert '2 pairs' in text
    assert 'RE and TE: means over those pairs' in text


def test_published_rows_stand_apart():
    from sgor_ros.evaluation.report.published import KITTI_10M
    sgor, = (row for row in KITTI_10M if row.method == 'SGOR')
    assert sgor[1:] == (98.92, 0.51, 7.50, 92.70, 94.59, 93.53)
    assert latex(['a_b', 'RR %'], [['x', ''], ['y', '5']]).splitlines()[2:6] == [
        r'a\_b & RR \% \\', r'\midrule', r'x & -- \\', r'y & 5 \\']


def test_studies_change_what_they_say(drive):
    pair = strided([drive], [1]).pairs[0]
    config = posed([drive], 5.0).front_end.replace(max_correspondences=500, voxel_size=0.5)

    def made(**change):
        return front_end.shared_matches(pair, config, 0.6, studies.Variant(**change))
    whole_set, few = made(), made(matches=100)
    assert len(few.source) == 100
    given = {tuple(row) for row in np.hstack((whole_set.source, whole_set.target))}
    assert all(tuple(row) in given for row in np.hstack((few.source, few.target)))
    assert np.array_equal(made(matches=100).source, few.source)
    labels = whole_set.correspondences.source_labels
    two = made(categories=2).correspondences.source_labels
    assert len(np.unique(labels[labels > 0])) > 2 >= len(np.unique(two[two > 0]))
    noisy = made(random_labels=0.9).correspondences.source_labels
    assert np.bincount(noisy, minlength=20).std() < np.bincount(labels, minlength=20).std()
    assert [v.name for v in studies.variants('noise', None, 0)][:2] == ['0', '0.1']


def test_features_from_files(tmp_path, drive):
    """Descriptors that are the same for the same place: every match is right."""
    pair = strided([drive], [1]).pairs[0]
    rng = np.random.default_rng(0)
    seen = pair.source.read().points.astype(np.float64)
    # keypoints have to lie on the scans, and off the ground
    places = rng.permutation(seen[(seen[:, 2] > -0.5) & (np.linalg.norm(seen, axis=1) < 30)])[:600]
    described = rng.normal(size=(len(places), 32)).astype(np.float32)
    for frame, T in ((pair.source, np.eye(4)), (pair.target, pair.T_target_source)):
        path = tmp_path / f'{frame.name}.npz'
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, points=se3.transform(T, places), descriptors=described)
    config = strided([drive], [1]).front_end.replace(semantics='none', secondary_ground=False)
    found = front_end.shared_matches(pair, config, 0.6, studies.Variant(),
                                     front_end.Features(tmp_path))
    moved = se3.transform(pair.T_target_source, found.source)
    right = np.linalg.norm(moved - found.target, axis=1) < 1e-6
    assert right.sum() > 50
    # those whose partner the target has not seen are matched to something else
    assert right.mean() > 0.5
    with pytest.raises(InputError, match='expected arrays points and descriptors'):
        front_end.Features(tmp_path / 'none').read(pair.source)


def test_depth_map_by_hand(tmp_path):
    """A pixel in the middle lies ahead; one right of it by z / f; unseen ones are left out."""
    K = np.array([[100.0, 0, 2], [0, 100, 1], [0, 0, 1]])
    depth = np.zeros((3, 5))
    depth[1, 2], depth[1, 4] = 2.0, 3.0
    points, seen = cloud_of_depth(depth, K)
    assert points == pytest.approx(np.array([[0, 0, 2.0], [0.06, 0, 3.0]]))
    assert seen.sum() == 2
    np.savetxt(tmp_path / 'camera-intrinsics.txt', K)
    for i in range(3):
        Image.fromarray((1000 * depth).astype(np.uint16)).save(
            tmp_path / f'frame-{i:06d}.depth.png')
        Image.fromarray(np.full((3, 5), 7 + i, np.uint8)).save(
            tmp_path / f'frame-{i:06d}.label.png')
        np.savetxt(tmp_path / f'frame-{i:06d}.pose.txt',
                   se3.compose(np.eye(3), np.array([0.1 * i, 0, 0])))
    protocol = depth_frames(tmp_path, 2)
    pair, = protocol.pairs
    assert pair.T_target_source[:3, 3] == pytest.approx([0.2, 0, 0])
    scan = pair.source.read()
    assert scan.points == pytest.approx(points)
    assert scan.labels.tolist() == [9, 9]


@needs_data
@pytest.mark.parametrize(('names', 'inlier', 'count'), [('kitti_*', 0.6, 3), ('3d*', 0.1, 1)])
def test_matches_from_files(tmp_path, names, inlier, count):
    """The shared sets, thinned by a study too."""
    protocol = given_matches(DATA / 'correspondences', names, inlier)
    found = run(protocol, [Method('m', on_matches=centroid)], tmp_path,
                variants=[studies.Variant('all'), studies.Variant('9', matches=9)])
    assert len(found) == 2 * count
    assert all(r.matches > 4000 and r.right_share > 0.008 for r in found[:count])
    assert {r.matches for r in found[count:]} == {9}


@needs_data
def test_3dmatch_runs_to_its_end(tmp_path):
    """The pair that is here, with the truth of its log, by SC2-PCR."""
    from sgor_ros.evaluation.methods.sc2_pcr import sc2_pcr
    protocol = threedmatch(DATA / 'indoor')
    pair, = protocol.pairs
    assert (pair.name, pair.group) == ('7-scenes-redkitchen 4 0', '7-scenes-redkitchen')
    assert protocol.missing > 100
    found, = run(protocol, [Method('SC2-PCR', on_matches=sc2_pcr)], tmp_path)
    assert found.within


@needs_data
def test_refined_truth_is_kept(tmp_path):
    """ICP of real scans from poses that are 5 cm off; the second time nothing is read."""
    from sgor_ros.io.datasets import open_drives
    drive, = open_drives(DATA / 'kitti/08')
    T = drive.T_world_sensor
    pair = strided([replace(drive, T_world_sensor=T[:len(drive.scans)])], [3]).pairs[0]
    off = replace(pair, T_target_source=se3.compose(np.eye(3), np.array([0.05, 0.05, 0.0]))
                  @ pair.T_target_source)
    cache = tmp_path / 'truth.json'
    first, = refined([pair], cache)
    again, = refined([off], tmp_path / 'other.json')
    assert np.linalg.norm(first.T_target_source[:3, 3] - again.T_target_source[:3, 3]) < 0.02
    kept, = refined([replace(pair, source=None)], cache)
    assert kept.T_target_source == pytest.approx(first.T_target_source)


OWN = """
import numpy as np


def shift(matches):
    from sgor_ros.evaluation.methods import Solution
    T = np.eye(4)
    T[:3, 3] = np.median(matches.target - matches.source, axis=0)
    return Solution(T)
"""


def test_the_command_with_a_method_of_ones_own(tmp_path):
    """Killed while it runs and started again: it ends, with pictures and all rows."""
    (tmp_path / 'mine.py').write_text(OWN)
    command = [sys.executable, '-m', 'sgor_ros.commands.tables', 'strides', '--scans', '7',
               '--strides', '3', '--limit', '4', '--methods', 'SGOR', 'SM', '--method',
               'mine:shift', '--output', 'out']
    path = tmp_path / 'out/pairs.csv'
    first = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 300
    while first.poll() is None and time.monotonic() < deadline:
        if path.is_file() and len(path.read_text().splitlines()) > 3:
            first.send_signal(signal.SIGKILL)
            break
        time.sleep(0.05)
    first.wait()
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert len(path.read_text().splitlines()) == 1 + 4 * 3
    for name in ('SGOR', 'SM', 'mine:shift'):
        assert f'| {name} | 4 |' in done.stdout
    for name in ('results.md', 'table.tex', 'errors.png', 'matches.png', 'setup.json'):
        assert (tmp_path / 'out' / name).stat().st_size > 100
    page = (tmp_path / 'out/results.md').read_text()
    assert 'With 4 pairs' in page
    other_world = subprocess.run([*command, '--seed', '1'], cwd=tmp_path, capture_output=True,
                                 text=True, timeout=300)
    assert other_world.returncode == 2
    assert 'out: holds a run with another data' in other_world.stderr
    # a smaller table does not replace the one that took longer
    command[command.index('--limit') + 1] = '2'
    smaller = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert smaller.returncode == 0, smaller.stderr
    assert 'out: the table there was of 4 pairs, 3 methods, 1 variants, this one is of 2 pairs, ' \
        '3 methods, 1 variants: that one is in out/earlier now' in smaller.stderr
    assert (tmp_path / 'out/earlier/results.md').read_text() == page
    assert (tmp_path / 'out/earlier/errors.png').is_file()
    assert 'With 2 pairs' in (tmp_path / 'out/results.md').read_text()


@pytest.mark.parametrize(('arguments', 'says'), [
    (['3dmatch'], 'name a folder by --data'),
    (['kitti-loops'], 'name the lists by --list'),
    (['poses', '--scans', '3', '--methods', 'nothing'], '--methods nothing: not one of SGOR'),
    (['poses', '--scans', '3', '--method', 'no_such:thing'], 'expected MODULE:FUNCTION')])
def test_what_the_command_refuses(tmp_path, arguments, says):
    done = subprocess.run([sys.executable, '-m', 'sgor_ros.commands.tables', *arguments],
                          cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 2
    assert says in done.stderr
    assert 'Traceback' not in done.stderr


def test_matches_can_be_sent_to_another_process():
    with multiprocessing.get_context('spawn').Pool(1) as pool:
        answer, = pool.map(centroid, [Matches.of(np.zeros((4, 3)), np.ones((4, 3)), 0.6)])
    assert answer.T_target_source[:3, 3] == pytest.approx([1, 1, 1])
