"""The node where it closes loops, over real DDS."""
from conftest import errors
from conftest import relative
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path
import numpy as np
import pytest
from return_drive import return_drive
from return_drive import THERE
import ros_helpers as ros

from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.playback.node_process import NodeProcess

pytest.importorskip('gtsam')

PERIOD_NS = 100_000_000


def stamp_of(index):
    return ros.START_NS + index * PERIOD_NS


def send(partner, drive, indices):
    """Send some scans one by one; return what the node says of each."""
    return [partner.outcome(ros.cloud(*drive[at][:2], stamp_of(i))) for i, at in indices]


@pytest.fixture
def node(domain, tmp_path):
    with NodeProcess(domain, tmp_path / 'log', '-p', 'loop_closure:=true') as node:
        yield node
        assert node.stop() == 0


def test_loops_are_closed_and_the_path_is_right(domain, node):
    drive = return_drive()
    with ros.Partner(domain) as partner:
        partner.wait_for_node(node.alive)
        loops, paths = partner.hear(Odometry, '/loop_closure'), partner.hear(Path, '/path')
        told = send(partner, drive, enumerate(range(len(drive))))
        assert all(values['state'] in ('tracking', 'new track') for *_, values in told)
        # pairs are registered meanwhile, and taken in with the next scans
        last = len(drive) - 1
        for more in range(1, 120):
            if len(loops) > 5:
                break
            told += send(partner, drive, [(last + more, last - more % 2)])
            partner.spin_for(0.5)    # the process has what other programs leave it
        assert len(loops) > 5
        for loop in loops:
            target, source = ((int(name.removeprefix('lidar@')) - ros.START_NS) // PERIOD_NS
                              for name in (loop.header.frame_id, loop.child_frame_id))
            if source <= last:
                true = relative(drive[target][2], drive[source][2])
                assert errors(matrix_of(loop.pose.pose), true)[0] < 0.1
        assert int(told[-1][2]['loops']) >= len(loops) - 1
        assert paths[-1].header.frame_id == 'map'
        for stamped in paths[-1].poses:
            index = (stamp_ns_of(stamped.header) - ros.START_NS) // PERIOD_NS
            if index <= last:
                true = relative(drive[0][2], drive[index][2])
                assert errors(matrix_of(stamped.pose), true)[0] < 0.15


def test_kidnapped_it_is_at_the_right_place_with_the_second_scan(domain, node):
    drive = return_drive()
    with ros.Partner(domain) as partner:
        partner.wait_for_node(node.alive)
        paths = partner.hear(Path, '/path')
        send(partner, drive, enumerate(range(THERE)))
        told = send(partner, drive, [(THERE, -3), (THERE + 1, -2)])
        assert 'another place of the map' in told[0][1]
        partner.spin_until(lambda: stamp_ns_of(paths[-1].header) == stamp_of(THERE + 1), 5.0)
        end = paths[-1].poses[-1]
        assert stamp_ns_of(end.header) == stamp_of(THERE + 1)
        metres, degrees = errors(matrix_of(end.pose), relative(drive[0][2], drive[-2][2]))
        assert metres < 0.2
        assert degrees < 1
        # odom goes on as it went
        odometry = [matrix_of(one.pose.pose) for one in partner.odometry]
        assert np.linalg.norm(relative(odometry[THERE - 1], odometry[-1])[:3, 3]) < 6
