"""What the benchmark counts as kept, refused, admitted and wrong."""
import csv

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from sgor_ros.commands.benchmark import main
from sgor_ros.commands.scene_pairs import scene_pairs
from sgor_ros.core.common import se3
from sgor_ros.core.verdict.result import Placement
from sgor_ros.core.verdict.result import Registration
from sgor_ros.core.verdict.result import Status
from sgor_ros.evaluation.methods import Answer
from sgor_ros.evaluation.methods import Method
from sgor_ros.evaluation.metrics import reliability
from sgor_ros.evaluation.metrics.pose_error import nees
from sgor_ros.evaluation.metrics.pose_error import NEES_BOUND
from sgor_ros.evaluation.metrics.registration_recall import outcomes
from sgor_ros.evaluation.metrics.row import Row
from sgor_ros.evaluation.protocols.pairs import Pair
from sgor_ros.evaluation.report import outcomes as report
from sgor_ros.evaluation.runner import run_pairs
from sgor_ros.world.scenes import KINDS

NAN = float('nan')


def row(*, right=True, within=True, valid=True, **changes):
    values = {'method': 'm', 'data_set': 'd', 'source': 's', 'target': 't', 'right': right,
              'distance_m': 5.0, 'rotation_error_deg': 0.1, 'translation_error_m': 0.02,
              'within': within, 'valid': valid, 'score': 0.9, 'seconds': 0.1,
              'seconds_one_new': 0.05, 'confidence': 0.9}
    return Row(**values | changes)


def exp_left(noise, T):
    """Move T by noise (x, y, z, rotation): its origin, and its orientation from the left."""
    R = Rotation.from_rotvec(noise[3:]).as_matrix() @ T[:3, :3]
    return se3.compose(R, T[:3, 3] + noise[:3])


def test_nees_is_six_on_average_where_the_covariance_is_right():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(6, 6)) * np.array([0.1, 0.02, 0.3, 0.001, 0.004, 0.002])[:, None]
    covariance = A @ A.T
    T = exp_left(np.array([4.0, -3, 1, 0.2, -0.4, 2.0]), np.eye(4))
    found = np.array([nees(T, exp_left(noise, T), covariance)
                      for noise in rng.multivariate_normal(np.zeros(6), covariance, 4000)])
    assert found.mean() == pytest.approx(6.0, abs=0.25)
    assert np.mean(found > chi2.ppf(0.9, 6)) == pytest.approx(0.1, abs=0.02)
    assert np.mean(found > NEES_BOUND) < 0.008


def test_nees_without_a_covariance_and_with_an_overconfident_one():
    T = exp_left(np.array([0.1, 0, 0, 0, 0, 0]), np.eye(4))
    assert np.isnan(nees(np.eye(4), T, None))
    assert nees(np.eye(4), T, np.zeros((6, 6))) == float('inf')
    # a direction in which metres are unknown excuses metres, and only there
    free = np.diag([25.0, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6])
    far = exp_left(np.array([8.0, 0, 0, 0, 0, 0]), np.eye(4))
    aside = exp_left(np.array([8.0, 0.1, 0, 0, 0, 0]), np.eye(4))
    assert nees(np.eye(4), far, free) == pytest.approx(64 / 25)
    assert nees(np.eye(4), aside, free) > NEES_BOUND


def test_three_sigma_is_of_six_dimensions():
    assert chi2.cdf(NEES_BOUND, 6) == pytest.approx(0.9973)


def test_each_outcome_is_counted_once_where_it_belongs():
    rows = [
        row(nees=3.0), row(nees=30.0), row(valid=False), row(within=False),
        row(within=False, valid=False),
        row(within=False, valid=False, degenerate=1, nees=5.0),
        row(within=False, valid=False, degenerate=2, nees=25.0),
        row(valid=False, degenerate=1, nees=NAN),    # claims nothing, so holds nothing
        row(within=False, valid=False, alternatives=3),
        row(right=False, within=False), row(right=False, within=False, valid=False),
        row(right=False, within=False, valid=False, degenerate=1),
        row(right=False, within=False, valid=False, alternatives=1),
    ]
    found = outcomes(rows)
    assert (found.same, found.different) == (9, 4)
    assert (found.right_kept, found.right_refused, found.wrong_accepted) == (2, 2, 1)
    assert (found.degenerate, found.outside, found.ambiguous) == (3, 2, 1)
    assert (found.accepted, found.different_degenerate, found.different_ambiguous) == (1, 1, 1)
    assert found.wrong == 1 + 2 + 1
    assert found.nees_mean == pytest.approx(16.5)
    assert found.nees_within == 0.5


def test_nothing_to_count_gives_no_figures():
    found = outcomes([])
    assert (found.same, found.different, found.wrong) == (0, 0, 0)
    assert np.isnan(found.nees_mean)
    assert '| 0 | - |' in report.outcome_table([row(method='other')], ['m'])


def test_the_table_has_a_line_for_each_kind_and_method():
    rows = [row(data_set='tunnel', within=False), row(data_set='field', nees=6.0),
            row(data_set='field', method='n', valid=False),
            row(data_set='field', right=False, within=False)]
    table = [[cell.strip() for cell in line.strip('|').split('|')]
             for line in report.outcome_table(rows, ['m', 'n'], {'tunnel'}).splitlines()[2:]]
    lines = {cells[0]: cells[1:] for cells in table}
    assert list(lines) == ['tunnel (repeats): m', 'tunnel (repeats): n', 'field: m', 'field: n',
                           '**all**: m', '**all**: n']
    assert lines['tunnel (repeats): m'][:4] == ['1', '0', '0', '1']
    assert lines['field: m'] == ['1', '1', '0', '0', '0', '0', '0', '1', '1', '0', '0', '6',
                                 '100 %']
    assert lines['field: n'][:4] == ['1', '0', '1', '0']
    assert lines['**all**: m'][:4] == ['2', '1', '0', '1']
    said = report.wrong_claims(rows, ['m'])
    assert 'm: wrong 2 of 3 (1 wrong answers and 1 pairs of different places' in said


def test_reliability_asks_all_candidates_refused_ones_too():
    rows = [row(confidence=0.97), row(confidence=0.99, within=False),
            row(confidence=1.0, right=False, within=False), row(confidence=0.5, valid=False),
            row(confidence=NAN, within=False)]
    low, high = reliability.reliability_diagram(rows)
    assert (low.low, low.high, low.answers, low.right) == (0.4, 0.6, 1, 1)
    assert (high.low, high.high, high.answers, high.right) == (0.95, 1.0, 3, 1)
    assert high.mean == pytest.approx((0.97 + 0.99 + 1.0) / 3)
    lines = report.reliability_table(rows, ['m']).splitlines()
    assert lines[-1] == '| 0.95-1 | 33 % of 3 |'
    assert '| 0-0.2 | - |' in lines


@pytest.fixture(scope='module')
def corridors():
    return scene_pairs('corridor', 2, seed=0)


def test_what_a_registration_says_of_itself_reaches_its_row(corridors):
    pair = corridors[0]

    def answer(sample):
        free = np.zeros((1, 6))
        free[0, 0] = 1.0
        covariance = np.diag([100.0, 0.01, 0.01, 1.0, 1.0, 1.0])
        other = Placement(np.eye(4), covariance, np.empty((0, 6)))
        result = Registration(Status.AMBIGUOUS, 'slides', np.eye(4), np.empty((0, 3)),
                              np.empty((0, 3)), np.empty(0, bool), 0.7, covariance,
                              degenerate=free, alternatives=(other, other))
        return Answer(np.eye(4), valid=False, score=0.0, result=result)

    found, = run_pairs([pair], [Method('m', answer)], seed=0)
    assert (found.confidence, found.degenerate, found.alternatives) == (0.7, 1, 2)
    assert found.nees > 0
    # heights that nobody knows are no error
    blind = Pair(pair.source, pair.target, pair.T_target_source, heights_known=False)
    assert np.isnan(run_pairs([blind], [Method('m', answer)], seed=0)[0].nees)
    # other methods give nothing of the kind
    other, = run_pairs([pair], [Method('r', lambda _: Answer(np.eye(4), score=1.0))], seed=0)
    assert np.isnan(other.confidence)
    assert other.degenerate == 0


def test_scene_pairs_are_of_the_same_place_and_then_of_different_ones(corridors):
    assert [pair.right for pair in corridors] == [True, True, False, False]
    assert all(pair.data_set == 'corridor' for pair in corridors)
    for pair in corridors[:2]:
        assert 0.9 < pair.distance_m < 8.1
        a, b = pair.target.read(), pair.source.read()
        moved = se3.transform(pair.T_target_source, b.points.astype(float))
        near = moved[np.linalg.norm(moved, axis=1) < 3.0]
        assert len(near) > 100
        distance, _ = cKDTree(a.points).query(near)
        assert np.median(distance) < 0.06
        assert pair.source.name.split('/')[1] == pair.target.name.split('/')[1]
    for pair in corridors[2:]:
        assert pair.T_target_source is None
        assert pair.source.name.split('/')[1] != pair.target.name.split('/')[1]


def test_scene_pairs_follow_from_the_seed(corridors):
    again, other = scene_pairs('corridor', 1, seed=0), scene_pairs('corridor', 1, seed=1)
    assert np.array_equal(again[0].T_target_source, corridors[0].T_target_source)
    assert np.array_equal(again[0].source.read().points, corridors[0].source.read().points)
    assert not np.array_equal(other[0].T_target_source, again[0].T_target_source)


def test_wrong_command_tells_kinds_of_place_apart(tmp_path, capsys):
    out = tmp_path / 'out'
    assert main(['wrong', '--limit', '0', '--count', '0', '--per-kind', '1', '--kinds', 'field',
                 'corridor', '--output', str(out)]) == 0
    with open(out / 'rows.csv') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 2    # kinds, same and different, with labels and without
    assert {r['data_set'] for r in rows} == {'field', 'corridor'}
    field = next(r for r in rows if r['data_set'] == 'field' and r['right'] == 'True'
                 and r['method'] == 'SGOR')
    assert field['within'] == 'True'
    assert 0 < float(field['nees']) < 200
    assert 0 < float(field['confidence']) <= 1
    table = (out / 'table.md').read_text()
    assert '| field: SGOR, no labels | 1 |' in table
    assert '| corridor (repeats): SGOR | 1 |' in table
    assert 'SGOR: wrong ' in table
    assert (out / 'reliability.png').stat().st_size > 10_000
    assert not (out / 'confidence.png').exists()
    captured = capsys.readouterr()
    assert table.strip() in captured.out
    assert 'corridor, 2 of 2 kinds' in captured.err


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--kinds', 'mine'], f'--kinds mine: not one of {", ".join(KINDS)}'),
    (['--limit', '0', '--count', '0', '--per-kind', '0'], 'nothing is left to do')])
def test_unusable_options_are_told_in_one_line(arguments, message, tmp_path, capsys):
    assert main(['wrong', *arguments, '--output', str(tmp_path / 'out')]) == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]
