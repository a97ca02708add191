"""The demo as `make demo` runs it, short."""
import re
import struct
import subprocess
import sys

import numpy as np
import pytest

from sgor_ros.commands.demo import forth_and_back
from sgor_ros.commands.world_bag import write_world_bag
from sgor_ros.core.common import se3
from sgor_ros.core.common.settings import InputError
from sgor_ros.evaluation.metrics.trajectory import track_errors
from sgor_ros.io.bags import BagReader
from sgor_ros.world import simulate


def run_demo(*arguments):
    return subprocess.run([sys.executable, '-m', 'sgor_ros.commands.demo', *map(str, arguments)],
                          capture_output=True, text=True, timeout=400)


def test_demo_plays_the_world_and_agrees_with_the_truth(tmp_path):
    # slow enough that no scan is replaced on a busy machine either
    done = run_demo('--scans', 6, '--rate', 0.7, '--out', tmp_path / 'demo')
    assert done.returncode == 0, done.stdout + done.stderr
    table = dict(re.split(r' {2,}', line.strip(), maxsplit=1)
                 for line in done.stdout.splitlines() if '  ' in line.strip())
    assert table['scans sent'] == '6'
    assert table['processed'] == '6'
    assert table['replaced by a newer one'] == '0'
    te_cm = float(re.search(r'median ([\d.]+) cm', table['TE of consecutive pairs']).group(1))
    assert te_cm < 5
    assert float(re.match(r'([\d.]+) m', table['end of the track, after 4 m']).group(1)) < 0.2
    for name in ('trajectory.png', 'errors.png'):
        width, height = struct.unpack('>II', (tmp_path / 'demo' / name).read_bytes()[16:24])
        assert min(width, height) > 400
    assert 'received 6, processed 6' in (tmp_path / 'demo/node.log').read_text()


def test_a_bag_of_another_place_has_its_clouds_and_truth(tmp_path):
    truth, world = write_world_bag(tmp_path / 'bag', 3, 0, 'courtyard')
    with BagReader(tmp_path / 'bag') as reader:
        clouds = list(reader.clouds(reader.find_topic('label')))
    assert len(clouds) == len(truth) == 3
    poses = np.array(list(truth.values()))
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) == pytest.approx(0.3, rel=0.1)
    assert 50 in world.labels
    assert np.abs(world.points[world.labels == 48, 2]).max() < 0.2


def test_demo_lists_the_places_that_there_are(tmp_path):
    with pytest.raises(InputError, match=r"place 'moon': not one of street, tunnel, .*courtyard"):
        write_world_bag(tmp_path / 'bag', 3, 0, 'moon')


def test_demo_on_a_machine_that_is_too_slow(tmp_path):
    """As any is for this rate: it says so, shows what it could do, and that is no failure."""
    done = run_demo('--scans', 20, '--rate', 100, '--out', tmp_path / 'demo')
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'too slow, or too busy, for 100 scans a second' in done.stdout
    answered = int(re.search(r'each time, (\d+) of 20', done.stdout).group(1))
    assert 2 <= answered < 18
    assert 0.1 < float(re.search(r'--rate ([\d.]+) would', done.stdout).group(1)) < 100
    assert re.search(r'TE of consecutive pairs +median', done.stdout)
    assert (tmp_path / 'demo/trajectory.png').is_file()


def test_long_drives_go_forth_and_back_with_stamps_that_go_on():
    played = list(forth_and_back([10, 13, 16], 7))
    assert played == [(10, 10), (13, 13), (16, 16), (13, 19), (10, 22), (13, 25), (16, 28)]


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--scans', '1'], '--scans 1: at least 2'),
    (['--rate', '0'], '--rate 0.0: 0.1 to 100')])
def test_demo_refuses_what_makes_no_sense(arguments, message, tmp_path):
    done = run_demo(*arguments, '--out', tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert 'Traceback' not in done.stderr


def test_demo_says_that_its_folder_cannot_be_used(tmp_path):
    (tmp_path / 'file').write_text('')
    done = run_demo('--out', tmp_path / 'file/demo')
    assert done.returncode == 2
    assert str(tmp_path / 'file/demo') in done.stderr
    assert 'Traceback' not in done.stderr


def test_track_is_laid_on_the_truth_at_its_first_pose():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    start = se3.compose(turn, np.array([5.0, 6, 7]))
    steps = np.array([se3.compose(np.eye(3), np.array([x, 0, 0])) for x in (0.0, 4, 10)])
    wrong = steps.copy()
    wrong[2, 1, 3] = 0.3
    errors = track_errors(wrong, start @ steps, (10.0,))
    assert errors.length_m == pytest.approx(10)
    assert errors.translation_m == pytest.approx([0, 0.3])
    assert errors.end_translation_m == pytest.approx(0.3)
    assert errors.drift.translation_percent == pytest.approx(3.0)
    # 0.3 m to the left of a start that looks along y
    assert errors.estimate[2, :3, 3] == pytest.approx([4.7, 16, 7])


def test_demo_plays_a_recorded_drive(tmp_path):
    """A few scans of the street as a folder: no labels and a truth that is not the identity."""
    drive = tmp_path / 'drive'
    (drive / 'velodyne').mkdir(parents=True)
    poses = []
    for i, (_, points, _, pose) in enumerate(simulate(4, seed=1)):
        np.hstack((points, points[:, :1])).astype(np.float32).tofile(
            drive / 'velodyne' / f'{i:06d}.bin')
        poses.append(pose[:3].ravel())
    np.savetxt(drive / 'poses.txt', poses)
    # forth and back: six scans of four
    done = run_demo('--data', drive, '--scans', 6, '--rate', 0.7, '--out', tmp_path / 'demo')
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r'processed +6\n', done.stdout)
    assert float(re.search(r'TE of consecutive pairs +median ([\d.]+) cm', done.stdout)[1]) < 5
    assert (tmp_path / 'demo/trajectory.png').stat().st_size > 10_000
    assert not (tmp_path / 'demo/bag').exists()


def test_demo_says_why_a_folder_is_no_drive(tmp_path):
    (tmp_path / 'velodyne').mkdir()
    np.ones((10, 4), np.float32).tofile(tmp_path / 'velodyne/0.bin')
    done = run_demo('--data', tmp_path, '--out', tmp_path / 'demo')
    assert done.returncode == 2
    assert 'no poses.txt' in done.stderr
