"""What docs/contributing.md tells a contributor to add works, done as it stands in a copy."""
from pathlib import Path
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from sgor_ros.io.trajectories import write_kitti

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = re.findall(r'```(python|diff)\n# (sgor_ros/\S+)\n(.*?)```',
                    (ROOT / 'docs/contributing.md').read_text(), re.DOTALL)


def changed(text, diff):
    """Return a file after the hunks of a page; what they take away or keep must be in it once."""
    for hunk in re.split(r'^@@\n', diff, flags=re.MULTILINE):
        lines = hunk.splitlines(keepends=True)
        old, new = (''.join(line[1:] for line in lines if line[0] in kept)
                    for kept in (' -', ' +'))
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@pytest.fixture(scope='module')
def copy(tmp_path_factory):
    """Return a folder with the package as it is after all that the page says."""
    folder = tmp_path_factory.mktemp('copy')
    # with what is compiled: only what the page changes is compiled anew
    for part in ('sgor_ros', 'config'):
        shutil.copytree(ROOT / part, folder / part)
    for kind, name, block in BLOCKS:
        path = folder / name
        assert path.exists() == (kind == 'diff')
        path.write_text(block if kind == 'python' else changed(path.read_text(), block))
    return folder


def run(folder, *command):
    done = subprocess.run([sys.executable, *command], cwd=folder, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_there_are_three_files_and_three_changes():
    assert [kind for kind, *_ in BLOCKS] == ['python', 'diff'] * 3


def test_a_data_set_is_recognised_and_read(copy, street, tmp_path):
    (tmp_path / 'cloud').mkdir()
    for i, (points, labels, _) in enumerate(street):
        np.column_stack((points, np.ones(len(points)))).astype(np.float32).tofile(
            tmp_path / f'cloud/{i:03d}.bin')
        labels.astype(np.uint32).tofile(tmp_path / f'cloud/{i:03d}.label')
    write_kitti(tmp_path / 'poses.txt', [T for *_, T in street])
    told = run(copy, '-c', 'import sys; from sgor_ros import open_drive\n'
               'drive = open_drive(sys.argv[1]); scan = drive.read(1)\n'
               'print(len(drive), drive.scans[1].data_set, len(scan.points),\n'
               '      int(scan.labels.sum()), float(drive.T_world_sensor[1, 0, 3]))',
               str(tmp_path))
    points, labels, T = street[1]
    count, name, *figures = told.split()
    assert (int(count), name) == (len(street), 'backpack')
    assert [float(each) for each in figures] == pytest.approx(
        [len(points), labels.sum(), T[0, 3]], abs=1e-6)


def test_a_descriptor_is_matched_by(copy):
    told = run(copy, '-c', """
import numpy as np
from sgor_ros import SemanticScan, SgorConfig, preprocess, register
from sgor_ros.world import simulate
config = SgorConfig().paper_steps()
(_, *a, T_a), (_, *b, T_b) = simulate(2, seed=0, speed=40.0)
target, source = (preprocess(SemanticScan(*scan), config) for scan in (a, b))
found = register(source, target, config)
truth = np.linalg.inv(T_a) @ T_b
print(source.features.descriptors.shape[1], found.status,
      float(np.linalg.norm((found.T_target_source - truth)[:3, 3])))""")
    width, status, metres = told.split()
    assert (int(width), status) == (33 + 3, 'registered')
    assert float(metres) < 0.3


def test_a_method_is_among_those_of_the_tables(copy):
    told = run(copy, '-c', """
import numpy as np
from sgor_ros.evaluation.methods import available, Matches, ON_MATCHES
points = np.random.default_rng(0).uniform(-9, 9, (50, 3))
method = available(ON_MATCHES, lambda text: None)['median shift']
answer = method.on_matches(Matches.of(points, points + (1, 2, 3), 0.6))
print(*answer.T_target_source[:3, 3].round(6))""")
    assert [float(each) for each in told.split()] == [1, 2, 3]
