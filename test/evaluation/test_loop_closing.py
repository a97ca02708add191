"""Others that close loops: their loops come out in our convention, judged by the truth."""
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from return_drive import return_drive
from return_drive import THERE

from sgor_ros.evaluation.loops import OtherRun
from sgor_ros.evaluation.methods.loop_closing import KissSlamLoops
from sgor_ros.evaluation.methods.loop_closing import loop_closers
from sgor_ros.evaluation.methods.loop_closing import MapClosuresLoops
from sgor_ros.evaluation.metrics.pose_error import rotation_error_deg
from sgor_ros.evaluation.metrics.pose_error import translation_error_m
from sgor_ros.evaluation.protocols.pairs import drive_of
from sgor_ros.evaluation.report.loop_table import others_table


@pytest.mark.parametrize(('package', 'make', 'length'), [('map_closures', MapClosuresLoops, 9.0),
                                                         ('kiss_slam', KissSlamLoops, 14.0)])
def test_loops_between_local_maps_are_right(package, make, length):
    pytest.importorskip(package)
    there = return_drive()[:THERE]
    # and back without a turn: a loop the wrong way round would be metres off
    scans = [*there, *there[::-1], *(there if package == 'kiss_slam' else [])]
    drive = drive_of('street', scans)
    closer = make(length)
    loops = [loop for scan in drive for loop in closer(scan.read().points)] + closer.finish()
    assert loops
    for loop in loops:
        assert loop.target < loop.source == loop.scans[0]
        assert loop.scans[-1] < len(scans)
    T = drive.T_world_sensor
    errors = [(translation_error_m(loop.T_target_source, true),
               rotation_error_deg(loop.T_target_source, true), np.linalg.norm(true[:3, 3]))
              for loop in loops
              for true in [np.linalg.inv(T[loop.target]) @ T[loop.source]]]
    right = [metres_apart for metres, degrees, metres_apart in errors
             if metres < 0.6 and degrees < 5]
    assert len(right) > len(errors) / 2
    assert max(right) > 2


def test_what_is_not_installed_is_left_out_and_named(monkeypatch):
    for package in ('map_closures', 'kiss_slam'):
        monkeypatch.setitem(sys.modules, package, None)
    said = []
    assert loop_closers(said.append) == {}
    assert 'map_closures' in said[0]
    assert 'kiss_slam' in said[1]


def test_others_stand_beside_the_mapper_in_the_table():
    ours = SimpleNamespace(drive='street', scans=10, revisits=4, closed=4, wrong=0,
                           error_m=np.array([0.01]), error_deg=np.array([0.1]), cpu_seconds=0.5)
    other = OtherRun('map-closures', 'street', 10, 4, 2, np.array([0.5, 3.0]),
                     np.array([1.0, 2.0]), 1, 0.2)
    lines = others_table([ours], [other]).splitlines()[2:]
    assert lines == ['| street | SGOR | 4 of 4 | 1 | 0 | 0.010 | 0.100 | 50 |',
                     '| street | map-closures | 2 of 4 | 2 | 1 | 1.750 | 1.500 | 20 |']
