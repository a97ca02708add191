"""`sgor_register` as a user runs it."""
import json
import re
import time

from conftest import errors
from conftest import relative
import numpy as np
import pytest

from sgor_ros import SgorConfig
from sgor_ros.commands import register as register_command
from sgor_ros.commands.register import main


@pytest.fixture(scope='module')
def pair(street, tmp_path_factory):
    """Return two scans of the street as files, and the truth."""
    folder = tmp_path_factory.mktemp('pair')
    for name, (points, labels, _) in (('source', street[3]), ('target', street[0])):
        np.savez(folder / f'{name}.npz', points=points, labels=labels)
    return (str(folder / 'source.npz'), str(folder / 'target.npz'),
            relative(street[0][2], street[3][2]))


def test_result_on_screen_in_json_and_as_picture(pair, tmp_path, capsys):
    source, target, truth = pair
    assert main([source, target, '--json', str(tmp_path / 'r.json'),
                 '--plot', str(tmp_path / 'r.png')]) == 0
    result = json.loads((tmp_path / 'r.json').read_text())
    metres, degrees = errors(np.array(result['T_target_source']), truth)
    assert metres < 0.1
    assert degrees < 0.3
    printed = capsys.readouterr().out.splitlines()
    np.testing.assert_allclose(np.array([row.split() for row in printed[1:5]], float),
                               result['T_target_source'], atol=1e-8)
    assert result['success']
    assert result['degenerate'] == result['alternatives'] == []
    assert 10 <= result['inliers'] <= result['correspondences']
    assert (tmp_path / 'r.png').read_bytes().startswith(b'\x89PNG')


def test_json_to_standard_output_is_nothing_but_json(pair, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([*pair[:2], '--json', '-']) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)['success']
    assert 'T_target_source' in said.err
    assert list(tmp_path.iterdir()) == [], 'no file of the name -'
    assert main([*pair[:2], '--plot', '-']) == 2


def test_the_time_is_that_of_the_whole_work(pair, tmp_path, capsys):
    begin = time.perf_counter()
    assert main([*pair[:2], '--json', str(tmp_path / 'r.json')]) == 0
    whole = time.perf_counter() - begin
    timings = json.loads((tmp_path / 'r.json').read_text())['timings_s']
    # two clouds of 40,000 points: no machine does that in less
    assert 2e-3 < timings['preprocessing'] < sum(timings.values()) < whole
    taken, of_them = re.search(r'took (\d+) ms, (\d+) of them to preprocess',
                               capsys.readouterr().out).groups()
    assert int(taken) == round(1e3 * sum(timings.values()))
    assert int(of_them) == round(1e3 * timings['preprocessing'])


def test_failure_is_exit_code_1_with_the_reason(pair, tmp_path, capsys):
    rng = np.random.default_rng(0)
    np.savez(tmp_path / 'noise.npz', points=rng.uniform(-30, 30, (20000, 3)))
    assert main([str(tmp_path / 'noise.npz'), pair[1], '--json', str(tmp_path / 'r.json')]) == 1
    result = json.loads((tmp_path / 'r.json').read_text())
    assert not result['success']
    assert result['T_target_source'] is None
    assert result['reason']
    assert f'not registered: {result["reason"]}' in capsys.readouterr().out


def test_one_point_is_a_failure_and_no_crash(pair, tmp_path, capsys):
    np.savez(tmp_path / 'one.npz', points=np.full((1, 3), 5.0))
    assert main([str(tmp_path / 'one.npz'), pair[1]]) == 1
    assert 'not registered' in capsys.readouterr().out


def test_options_reach_the_registration(pair, tmp_path, capsys):
    source, target, _ = pair
    assert main([source, target, '--min-inliers', '10000']) == 1
    assert 'min_inliers is 10000' in capsys.readouterr().out
    params = tmp_path / 'params.yaml'
    params.write_text('/**:\n  ros__parameters:\n    min_inliers: 9999\n    nonsense: 1\n'
                      '    7: 1\n')
    assert main([source, target, '--params-file', str(params)]) == 1
    said = capsys.readouterr()
    assert 'min_inliers is 9999' in said.out
    assert 'ignored: 7, nonsense' in said.err


@pytest.mark.parametrize(('options', 'says'), [
    (['--sigma-d', '99'], 'sigma_d = 99.0: above the maximum 5.0'),
    (['--label-convention', 'klingon'], "label_convention = 'klingon'"),
    (['--target-label-convention', 'klingon'], "label_convention = 'klingon'"),
    (['--source-labels', 'nowhere.label'], 'nowhere.label: no such file'),
    (['--params-file', 'nowhere.yaml'], '--params-file nowhere.yaml: cannot be read'),
])
def test_bad_options(pair, capsys, options, says):
    assert main([*pair[:2], *options]) == 2
    message = capsys.readouterr().err
    assert message.startswith('error: ')
    assert says in message


@pytest.mark.parametrize(('options', 'says'), [
    (['--plot', '{0}/pair.xyz'], 'pair.xyz: expected a name ending in .png, .pdf, .svg'),
    (['--plot', '{0}/nowhere/pair.png'], 'no folder {0}/nowhere'),
    (['--json', '{0}/nowhere/r.json'], 'no folder {0}/nowhere'),
    (['--json', '{0}'], 'is a folder'),
    (['--json', '{source}'], 'would replace an input'),
    (['--json', '{0}/a.png', '--plot', '{0}/a.png'], 'the same file as --json'),
])
def test_outputs_are_checked_before_the_work(pair, tmp_path, capsys, options, says, monkeypatch):
    monkeypatch.setattr(register_command, 'register', None)    # or it would be called
    options = [option.format(tmp_path, source=pair[0]) for option in options]
    assert main([*pair[:2], *options]) == 2
    said = capsys.readouterr()
    assert says.format(tmp_path) in said.err
    assert said.out == ''
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('ending', ['pdf', 'svg'])
def test_pictures_of_other_kinds(pair, tmp_path, ending):
    assert main([*pair[:2], '--plot', str(tmp_path / f'r.{ending}')]) == 0
    assert (tmp_path / f'r.{ending}').read_bytes()[:5] in (b'%PDF-', b'<?xml')


def test_a_picture_is_titled_by_the_files_as_they_were_named(pair, tmp_path, monkeypatch):
    """Not by where links lead."""
    for name, file in zip(('now.npz', 'before.npz'), pair[:2], strict=True):
        (tmp_path / name).symlink_to(file)
    monkeypatch.chdir(tmp_path)
    assert main(['now.npz', 'before.npz', '--plot', 'pair.svg']) == 0
    # letters are drawn as curves, and named in a comment
    assert '<!-- now.npz to before.npz: registered,' in (tmp_path / 'pair.svg').read_text()


@pytest.mark.parametrize('content', ['- a list', 'a: 1', '/**: {ros__parameters: 3}', '{',
                                     'a: 2020-13-45', '[' * 9999])
def test_bad_params_files(pair, tmp_path, capsys, content):
    params = tmp_path / 'params.yaml'
    params.write_text(content)
    assert main([*pair[:2], '--params-file', str(params)]) == 2
    assert f'error: --params-file {params}: ' in capsys.readouterr().err


def test_params_file_of_the_wrong_type(pair, tmp_path, capsys):
    params = tmp_path / 'params.yaml'
    params.write_text("/**:\n  ros__parameters:\n    sigma_d: 'wide'\n")
    assert main([*pair[:2], '--params-file', str(params)]) == 2
    assert "sigma_d = 'wide': expected float" in capsys.readouterr().err


def test_missing_and_unreadable_files(pair, tmp_path, capsys):
    assert main([str(tmp_path / 'a.bin'), pair[1]]) == 2
    assert 'a.bin: no such file' in capsys.readouterr().err
    (tmp_path / 'a.bin').write_bytes(b'123')
    assert main([str(tmp_path / 'a.bin'), pair[1]]) == 2
    assert '3 bytes are no points' in capsys.readouterr().err


def test_settings_for_studies_and_names_of_before_are_taken_and_not_shown(pair, tmp_path, capsys):
    """In options and in files; the shorter help is for those who do not study the method."""
    with pytest.raises(SystemExit):
        main(['--help'])
    shown = capsys.readouterr().out
    for name in ('ground-check', 'groups', 'quick-keypoints', 'rival-radius'):
        assert f'--{name}' not in shown
    assert '--hypothesis-radius' not in shown
    with pytest.raises(SystemExit):
        main(['--help-all'])
    shown = capsys.readouterr().out
    for name in ('ground-check', 'groups', 'quick-keypoints', 'hypothesis-radius'):
        assert f'--{name}' in shown
    assert '--rival-radius' not in shown
    file = tmp_path / 'params.yaml'
    file.write_text('/**:\n  ros__parameters:\n    group_keep: 3\n    group_size: 3\n')
    assert main([*pair[:2], '--params-file', str(file)]) == 2
    assert 'group_keep = 3: not below group_size = 3' in capsys.readouterr().err
    assert main([*pair[:2], '--group-keep', '2000']) == 2
    assert 'group_keep = 2000' in capsys.readouterr().err
    assert main([*pair[:2], '--rival-radius', '-1']) == 2
    assert 'hypothesis_radius = -1.0' in capsys.readouterr().err


def test_help_tells_units_bounds_and_defaults(capsys):
    with pytest.raises(SystemExit, match='0'):
        main(['--help-all'])
    said = ' '.join(capsys.readouterr().out.split())
    assert ('--sigma-d m Two correspondences are consistent when their lengths differ by less '
            f'[m]; at least 0.005, at most 5, default {SgorConfig().sigma_d:g}') in said
    assert '--hypothesis-radius m' in said


def test_real_pair_with_two_label_conventions(data_folder, tmp_path):
    pair = json.loads((data_folder / 'pairs.json').read_text())[3]    # 16 m apart
    arguments = [str(data_folder / name) for name in (pair['source'], pair['target'])]
    assert main([*arguments, '--source-labels', str(data_folder / pair['source_labels'][0]),
                 '--target-labels', str(data_folder / pair['target_labels'][0]),
                 '--label-convention', 'semantickitti_train',
                 '--target-label-convention', 'semantickitti',
                 '--json', str(tmp_path / 'r.json')]) == 0
    result = json.loads((tmp_path / 'r.json').read_text())
    metres, degrees = errors(np.array(result['T_target_source']), pair['T_target_source'])
    assert metres < 0.1
    assert degrees < 0.5


@pytest.mark.parametrize('preset', [[], ['--preset', 'indoor']])
def test_real_indoor_pair(data_folder, tmp_path, capsys, preset):
    """As any space; the preset that was for it is deprecated, and works."""
    lines = (data_folder / 'indoor/7-scenes-redkitchen_gt.log').read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.split()[:2] == ['0', '4'])
    truth = np.array([line.split() for line in lines[start + 1:start + 5]], float)
    assert main([str(data_folder / 'indoor/cloud_bin_4.ply'),
                 str(data_folder / 'indoor/cloud_bin_0.ply'), *preset,
                 '--json', str(tmp_path / 'r.json')]) == 0
    result = json.loads((tmp_path / 'r.json').read_text())
    metres, degrees = errors(np.array(result['T_target_source']), truth)
    assert metres < 0.1
    assert degrees < 3.0
    assert ('--preset indoor is deprecated' in capsys.readouterr().err) == bool(preset)


def test_a_number_is_no_name_of_a_setting(pair, tmp_path, capsys):
    params = tmp_path / 'params.yaml'
    params.write_text('/**:\n  ros__parameters:\n    5: 3\n    nonsense: 1\n')
    assert main([*map(str, pair[:2]), '--params-file', str(params)]) == 0
    assert 'so ignored: 5, nonsense' in capsys.readouterr().err
