"""Other methods on raw scans find an easy pair, odometries follow a short drive."""
import sys

import numpy as np
import pytest

from sgor_ros.evaluation.job import turned
from sgor_ros.evaluation.methods import available
from sgor_ros.evaluation.methods import ON_SCANS
from sgor_ros.evaluation.methods.odometries import kiss_icp
from sgor_ros.evaluation.methods.odometries import scan_to_scan
from sgor_ros.evaluation.metrics.pose_error import rotation_error_deg
from sgor_ros.evaluation.metrics.pose_error import translation_error_m
from sgor_ros.evaluation.protocols import pairs as pairing

NAMES = {'kiss-matcher-0.3': 'kiss_matcher', 'kiss-matcher-0.5': 'kiss_matcher',
         'ransac': 'open3d', 'fgr': 'open3d'}


@pytest.fixture(scope='module')
def drive(street):
    return pairing.drive_of('street', street)


@pytest.mark.parametrize('name', ['kiss-matcher-0.3', 'kiss-matcher-0.5', 'ransac'])
def test_another_method_finds_an_easy_pair(name, drive):
    pytest.importorskip(NAMES[name])
    scans, truth = turned(pairing.near_pairs([drive], 2.0)[0], seed=1)
    answer = ON_SCANS[name].on_scans(scans)
    assert rotation_error_deg(answer.T_target_source, truth) < 5
    assert translation_error_m(answer.T_target_source, truth) < 0.6
    assert answer.valid
    assert answer.seconds > 0


def test_fast_global_registration_finds_a_cloud_in_itself(drive):
    pytest.importorskip('open3d')
    frame = drive.scans[0]
    scans, truth = turned(pairing.Pair(frame, frame, np.eye(4)), seed=1)
    answer = ON_SCANS['fgr'].on_scans(scans)
    assert rotation_error_deg(answer.T_target_source, truth) < 5
    assert translation_error_m(answer.T_target_source, truth) < 0.6


@pytest.mark.parametrize('make', [kiss_icp, lambda: scan_to_scan(threads=2)])
def test_an_odometry_follows_the_street(make, drive):
    pytest.importorskip('kiss_icp')
    step = make()
    poses = [step(frame.read().points) for frame in drive.scans]
    first = np.linalg.inv(poses[0])
    truth = np.linalg.inv(drive.T_world_sensor[0]) @ drive.T_world_sensor[-1]
    assert np.linalg.norm(truth[:3, 3]) > 4
    assert translation_error_m(first @ poses[-1], truth) < 0.3
    assert rotation_error_deg(first @ poses[-1], truth) < 1


def test_methods_that_are_not_installed_are_left_out_and_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'kiss_matcher', None)
    said = []
    left = available(ON_SCANS, said.append)
    assert not [name for name in left if name.startswith('kiss-matcher')]
    assert any('kiss_matcher is not installed' in text for text in said)
