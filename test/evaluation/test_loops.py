"""Loops judged by the truth: drives that return, revisits, and the table."""
from conftest import errors
from conftest import relative
import numpy as np
import pytest
from return_drive import return_drive
from return_drive import THERE

from sgor_ros import SgorConfig
from sgor_ros.evaluation.loops import run_loops
from sgor_ros.evaluation.protocols.pairs import drive_of
from sgor_ros.evaluation.protocols.returns import there_and_back
from sgor_ros.evaluation.report.loop_table import loop_records
from sgor_ros.evaluation.report.loop_table import loop_table

pytest.importorskip('gtsam')
pytest.importorskip('evo')


@pytest.mark.parametrize('count', [5, 6])
def test_every_scan_is_met_once_and_comes_back_turned(count):
    drive = drive_of('street', return_drive()[:count])
    back = there_and_back(drive, 0.5)
    assert len(back) == (5 if count == 5 else 6)
    order = [0, 2, 4, 3, 1] if count == 5 else [0, 2, 4, 5, 3, 1]
    stamps_ns = [scan.stamp_ns for scan in back]
    assert stamps_ns == sorted(set(stamps_ns))
    for i, (scan, at) in enumerate(zip(back, order, strict=True)):
        moved = relative(drive.T_world_sensor[at], back.T_world_sensor[i])
        assert errors(moved, np.eye(4))[1] == pytest.approx(0 if i < 3 else np.degrees(0.5))
        # a point of the world stays where it was
        one, other = scan.read().points[100], drive.read(at).points[100]
        np.testing.assert_allclose((back.T_world_sensor[i] @ [*one, 1])[:3],
                                   (drive.T_world_sensor[at] @ [*other, 1])[:3], atol=1e-4)


def test_a_run_counts_revisits_and_errors():
    drive = drive_of('street', return_drive()[:THERE + 14])
    run = run_loops(drive, SgorConfig())
    assert (run.scans, run.with_pose, run.parts, run.wrong) == (len(drive), len(drive), 1, 0)
    assert len(run.error_m) == len(run.nees) == len(run.mapper.graph.loops) > 0
    assert run.error_m.max() < 0.1
    assert run.ape_after_m < 0.1
    assert run.freedom == 6 * len(run.error_m)
    # 60 m of way between: the drive turns after 42 m, so only those far back are revisits
    assert run.revisits <= run.nodes
    table = loop_table([run])
    assert f'| {run.closed} of {run.revisits} | {len(run.error_m)} | 0 |' in table
    kinds = [record['kind'] for record in loop_records([run])]
    assert kinds.count('loop') == len(run.error_m)
    # one part: an edge for each node but the first
    assert kinds.count('odometry') == len(run.odometry_nees) == run.nodes - 1
    assert run.odometry_nees.mean() < 12
