"""The node in a map of before, over real DDS."""
from conftest import errors
from conftest import relative
from nav_msgs.msg import Path
import pytest
from return_drive import known_map
from return_drive import return_drive
from return_drive import THERE
from return_drive import TURN
import ros_helpers as ros
from std_srvs.srv import Trigger

from sgor_ros import Map
from sgor_ros.io.header_stamp import stamp_ns_of
from sgor_ros.io.messages import matrix_of
from sgor_ros.ros.playback.node_process import NodeProcess

pytest.importorskip('gtsam')

PERIOD_NS = 100_000_000
BACK = THERE + TURN


def stamp_of(index):
    return ros.START_NS + index * PERIOD_NS


def test_it_finds_itself_in_the_map_and_saves_what_is_new(domain, tmp_path):
    folder, drive = tmp_path / 'yard', return_drive()
    known_map().save(folder)
    with NodeProcess(domain, tmp_path / 'log', '-p', 'loop_closure:=true', '-p',
                     f'map_folder:={folder}') as node:
        with ros.Partner(domain) as partner:
            partner.wait_for_node(node.alive)
            paths = partner.hear(Path, '/path')
            indexes = range(BACK, BACK + 8)
            for i, index in enumerate(indexes):
                level, _, values = partner.outcome(ros.cloud(*drive[index][:2], stamp_of(i)))
                assert values['state'] in ('tracking', 'new track'), level
            partner.spin_until(lambda: any(stamp_ns_of(path.header) == stamp_of(0)
                                           for path in paths), 5.0)
            # with the first scan already
            for path in paths:
                end = path.poses[-1]
                index = BACK + (stamp_ns_of(end.header) - ros.START_NS) // PERIOD_NS
                assert path.header.frame_id == 'map'
                metres, degrees = errors(matrix_of(end.pose), relative(drive[0][2],
                                                                       drive[index][2]))
                assert metres < 0.15
                assert degrees < 1
            answer = partner.call(Trigger, '/save_map', Trigger.Request())
            assert answer.success
            assert str(folder) in answer.message
        assert node.stop() == 0
    saved = Map.load(folder)
    assert saved.sessions == (0, 1)
    assert known_map().nodes.keys() < saved.nodes.keys()


def test_where_there_is_no_map_save_map_says_so(domain, tmp_path):
    with NodeProcess(domain, tmp_path / 'log') as node:
        with ros.Partner(domain) as partner:
            partner.wait_for_node(node.alive)
            answer = partner.call(Trigger, '/save_map', Trigger.Request())
            assert not answer.success
            assert 'map_folder' in answer.message
        assert node.stop() == 0


@pytest.mark.parametrize(('settings', 'said'), [
    (('loop_closure:=true', 'voxel_size:=0.4'), 'voxel_size = 0.4'),
    ((), 'needs loop_closure')])
def test_what_cannot_be_gone_on_in_is_said_at_the_start(domain, tmp_path, settings, said):
    known_map().save(tmp_path / 'yard')
    arguments = [text for setting in (*settings, f'map_folder:={tmp_path / "yard"}')
                 for text in ('-p', setting)]
    with NodeProcess(domain, tmp_path / 'log', *arguments) as node:
        assert node.process.wait(60) == 2
    assert said in (tmp_path / 'log').read_text()
